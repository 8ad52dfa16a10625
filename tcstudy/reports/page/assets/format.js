// Decoding of the packed data, numbers and units in words.
const TC = {};

TC.decode = async function (text) {
  const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const start = Math.ceil((4 + length) / 8) * 8;
  return TC.unpack(header, buffer, start);
};

TC.kinds = {
  f8: Float64Array,
  f4: Float32Array,
  i4: Int32Array,
  i2: Int16Array,
  i1: Int8Array,
  u2: Uint16Array,
};

TC.unpack = function (node, buffer, start) {
  if (Array.isArray(node)) return node.map((one) => TC.unpack(one, buffer, start));
  if (node === "inf") return Infinity;
  if (node === "-inf") return -Infinity;
  if (node === null || typeof node !== "object") return node;
  if (node.$) {
    const size = node.s.reduce((a, b) => a * b, 1);
    const array = new TC.kinds[node.$](buffer, start + node.o, size);
    array.shape = node.s;
    return array;
  }
  // without a prototype: a study may name an edge or a material "constructor"
  const record = Object.create(null);
  for (const [key, one] of Object.entries(node)) record[key] = TC.unpack(one, buffer, start);
  return record;
};

// Row p of values kept with 16 bits; missing ones are NaN.
TC.row = function (rows, p) {
  const n = rows.rows.shape[1];
  const scale = rows.scale[p];
  return Float64Array.from(rows.rows.subarray(p * n, (p + 1) * n), (q) =>
    q === -32768 ? NaN : q * scale,
  );
};

// Field p on the body: the sum of its modes.
TC.field = function (fields, p) {
  const rank = fields.factor.shape[1];
  const n = fields.mode.rows.shape[1];
  const out = new Float64Array(n);
  for (let j = 0; j < rank; j++) {
    const factor = fields.factor[p * rank + j] * fields.mode.scale[j];
    if (factor !== 0) for (let i = 0; i < n; i++) out[i] += factor * fields.mode.rows[j * n + i];
  }
  return out;
};

TC.symbol = (name) => TC.data.symbols[name] || name.replace(/_/g, " ");

TC.UP = {
  "-": "⁻",
  0: "⁰",
  1: "¹",
  2: "²",
  3: "³",
  4: "⁴",
  5: "⁵",
  6: "⁶",
  7: "⁷",
  8: "⁸",
  9: "⁹",
};
TC.unit = function (units) {
  if (!units || units === "1") return "";
  return units
    .replace(/([A-Za-zµ)])(-?\d+)/g, (_, a, b) => a + [...b].map((c) => TC.UP[c]).join(""))
    .replace(/ /g, " ");
};
TC.PREFIXES = [
  [1e9, "G"],
  [1e6, "M"],
  [1e3, "k"],
  [1, ""],
  [1e-3, "m"],
  [1e-6, "µ"],
  [1e-9, "n"],
];

// {by, unit}: what to divide by, and the unit with its prefix, so that the largest of the values reads well.
TC.scale = function (values, units) {
  const plain = { by: 1, unit: TC.unit(units) };
  if (!units || units === "1" || units === "K" || /^[A-Za-z]+-?\d/.test(units)) return plain;
  let most = 0;
  for (const v of values) if (Number.isFinite(v)) most = Math.max(most, Math.abs(v));
  if (most === 0) return plain;
  const [by, letter] = TC.PREFIXES.find(([size]) => most >= size) || TC.PREFIXES[6];
  if (units === "s" && by > 1) return plain;
  return { by, unit: letter + TC.unit(units) };
};

TC.number = function (value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [m, e] = value.toExponential(Math.max(0, digits - 2)).split("e");
    return `${m.replace("-", "−")}·10${[...String(Number(e))].map((c) => TC.UP[c]).join("")}`;
  }
  return String(Number(value.toPrecision(digits))).replace("-", "−");
};
TC.quantity = function (value, units, digits = 4) {
  const s = TC.scale([value], units);
  return `${TC.number(value / s.by, digits)}${s.unit ? " " + s.unit : ""}`;
};
// {by, unit} of a swept parameter: the unit that the study writes it in, else one prefix for the whole axis.
TC.axisScale = (axis) =>
  axis.scale ||
  (axis.scale = !axis.numeric
    ? { by: 1, unit: "" }
    : axis.written
      ? { by: axis.written[0], unit: axis.written[1] }
      : TC.scale(axis.values, axis.units));
// One value of a swept parameter, in one unit for the whole axis.
TC.axisLabel = function (axis, i) {
  if (!axis.numeric) return axis.values[i];
  if (!axis.digits) {
    // those that tell neighbours apart, but for what differs by rounding
    const v = Float64Array.from(axis.values).sort();
    let least = 1;
    for (let k = 1; k < v.length; k++) {
      const gap = (v[k] - v[k - 1]) / Math.max(Math.abs(v[k]), Math.abs(v[k - 1]));
      if (gap > 1e-11) least = Math.min(least, gap);
    }
    axis.digits = Math.max(4, 1 + Math.ceil(-Math.log10(least)));
  }
  return TC.number(axis.values[i] / TC.axisScale(axis).by, axis.digits);
};
TC.axisText = (axis, i) => `${TC.axisLabel(axis, i)} ${TC.axisScale(axis).unit}`.trim();
// One value with the name of its parameter.
TC.axisWords = (axis, i) =>
  `${TC.symbol(axis.name)}${axis.numeric ? " = " : ": "}${TC.axisText(axis, i)}`;
TC.short = (column) => column.name.replaceAll("_", " ");
TC.axisTitle = (axis) => TC.titled(TC.symbol(axis.name), TC.axisScale(axis));
TC.range = (values, none = [0, 1]) => {
  let lo = Infinity;
  let hi = -Infinity;
  for (const v of values)
    if (Number.isFinite(v)) {
      if (v < lo) lo = v;
      if (v > hi) hi = v;
    }
  return lo <= hi ? [lo, hi] : none;
};
