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

TC.ARRAY_TYPES = {
  f8: Float64Array,
  f4: Float32Array,
  i4: Int32Array,
  i2: Int16Array,
  i1: Int8Array,
  u2: Uint16Array,
};

TC.unpack = function (node, buffer, start) {
  if (Array.isArray(node)) return node.map((value) => TC.unpack(value, buffer, start));
  if (node === "inf") return Infinity;
  if (node === "-inf") return -Infinity;
  if (node === null || typeof node !== "object") return node;
  if (node.$) {
    const length = node.s.reduce((a, b) => a * b, 1);
    const array = new TC.ARRAY_TYPES[node.$](buffer, start + node.o, length);
    array.shape = node.s;
    return array;
  }
  // without a prototype: a study may name an edge or a material "constructor"
  const record = Object.create(null);
  for (const [key, value] of Object.entries(node)) record[key] = TC.unpack(value, buffer, start);
  return record;
};

// Row p of values kept with 16 bits; missing ones are NaN.
TC.row = function (rows, index) {
  const length = rows.rows.shape[1];
  const scale = rows.scale[index];
  return Float64Array.from(rows.rows.subarray(index * length, (index + 1) * length), (quantised) =>
    quantised === -32768 ? NaN : quantised * scale,
  );
};

// Field p on the body: the sum of its modes.
TC.field = function (fields, index) {
  const rank = fields.factor.shape[1];
  const length = fields.mode.rows.shape[1];
  const sum = new Float64Array(length);
  for (let mode = 0; mode < rank; mode++) {
    const factor = fields.factor[index * rank + mode] * fields.mode.scale[mode];
    if (factor !== 0)
      for (let node = 0; node < length; node++)
        sum[node] += factor * fields.mode.rows[mode * length + node];
  }
  return sum;
};

TC.symbol = (name) => TC.data.symbols[name] || name.replace(/_/g, " ");

TC.SUPERSCRIPTS = {
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
TC.superscript = (integer) =>
  [...String(integer)].map((character) => TC.SUPERSCRIPTS[character]).join("");
TC.unit = function (units) {
  if (!units || units === "1") return "";
  return units
    .replace(/([A-Za-zµ)])(-?\d+)/g, (_, letter, power) => letter + TC.superscript(power))
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

// {by, unit}: divisor and unit with the prefix that suits the largest of the values.
TC.scale = function (values, units) {
  const plain = { by: 1, unit: TC.unit(units) };
  if (!units || units === "1" || units === "K" || /^[A-Za-z]+-?\d/.test(units)) return plain;
  let largest = 0;
  for (const value of values)
    if (Number.isFinite(value)) largest = Math.max(largest, Math.abs(value));
  if (largest === 0) return plain;
  const [by, prefix] = TC.PREFIXES.find(([size]) => largest >= size) || TC.PREFIXES[6];
  if (units === "s" && by > 1) return plain;
  return { by, unit: prefix + TC.unit(units) };
};

TC.number = function (value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(Math.max(0, digits - 2)).split("e");
    return `${mantissa.replace("-", "−")}·10${TC.superscript(Number(exponent))}`;
  }
  return String(Number(value.toPrecision(digits))).replace("-", "−");
};
TC.quantity = function (value, units, digits = 4) {
  const scale = TC.scale([value], units);
  return `${TC.number(value / scale.by, digits)}${scale.unit ? " " + scale.unit : ""}`;
};
// {by, unit} of a swept parameter: the unit of the study file, else one prefix for the whole axis.
TC.axisScale = function (axis) {
  if (axis.scale) return axis.scale;
  if (!axis.numeric) axis.scale = { by: 1, unit: "" };
  else if (axis.written) axis.scale = { by: axis.written[0], unit: axis.written[1] };
  else axis.scale = TC.scale(axis.values, axis.units);
  return axis.scale;
};
// One value of a swept parameter, in one unit for the whole axis.
TC.axisLabel = function (axis, index) {
  if (!axis.numeric) return axis.values[index];
  if (!axis.digits) {
    // those that tell neighbours apart, but for what differs by rounding
    const sorted = Float64Array.from(axis.values).sort();
    let smallestGap = 1;
    for (let k = 1; k < sorted.length; k++) {
      const gap =
        (sorted[k] - sorted[k - 1]) / Math.max(Math.abs(sorted[k]), Math.abs(sorted[k - 1]));
      if (gap > 1e-11) smallestGap = Math.min(smallestGap, gap);
    }
    axis.digits = Math.max(4, 1 + Math.ceil(-Math.log10(smallestGap)));
  }
  return TC.number(axis.values[index] / TC.axisScale(axis).by, axis.digits);
};
TC.axisText = (axis, index) => `${TC.axisLabel(axis, index)} ${TC.axisScale(axis).unit}`.trim();
// One value with the name of its parameter.
TC.axisWords = (axis, index) =>
  `${TC.symbol(axis.name)}${axis.numeric ? " = " : ": "}${TC.axisText(axis, index)}`;
TC.shortName = (column) => column.name.replaceAll("_", " ");
TC.axisTitle = (axis) => TC.withUnit(TC.symbol(axis.name), TC.axisScale(axis));
TC.range = (values, fallback = [0, 1]) => {
  let lo = Infinity;
  let hi = -Infinity;
  for (const value of values)
    if (Number.isFinite(value)) {
      if (value < lo) lo = value;
      if (value > hi) hi = value;
    }
  return lo <= hi ? [lo, hi] : fallback;
};
