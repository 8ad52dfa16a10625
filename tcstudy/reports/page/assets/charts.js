// Small charts in SVG: scales, axes, marks. Colours come from the style sheet, so that dark mode and print follow.
TC.made = function (node, attrs, children) {
  for (const key in attrs) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), attrs[key]);
    else if (attrs[key] !== undefined && attrs[key] !== null && attrs[key] !== false)
      node.setAttribute(key, attrs[key] === true ? "" : attrs[key]);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
};
TC.svgNode = (tag, attrs = {}, ...children) =>
  TC.made(document.createElementNS("http://www.w3.org/2000/svg", tag), attrs, children);
TC.el = (tag, attrs = {}, ...children) => TC.made(document.createElement(tag), attrs, children);

TC.ticks = function (lo, hi, count) {
  const span = hi - lo || Math.abs(hi) || 1;
  const raw = span / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].find((s) => s * power >= raw) * power;
  const first = Math.ceil(lo / step - 1e-9);
  const last = Math.floor((hi + 1e-9 * span) / step);
  const out = [];
  for (let k = first; k <= last && out.length <= 4 * count; k++) out.push(k * step || 0);
  return out.length ? out : [lo];
};
TC.logTicks = function (lo, hi, count) {
  const a = Math.floor(Math.log10(lo) + 1e-9);
  const b = Math.ceil(Math.log10(hi) - 1e-9);
  const every = Math.max(1, Math.ceil((b - a) / Math.max(1, count)));
  for (const parts of [[1], [1, 2, 5], [1, 1.5, 2, 3, 5, 7]]) {
    const out = [];
    for (let e = a; e <= b; e += parts.length > 1 ? 1 : every)
      out.push(...parts.map((s) => s * 10 ** e).filter((v) => v >= lo * 0.999 && v <= hi * 1.001));
    if (out.length > 2) return out;
  }
  return [lo, hi];
};
TC.tickText = function (ticks) {
  const most = Math.max(...ticks.map(Math.abs));
  const step =
    ticks.length > 1 ? Math.min(...ticks.slice(1).map((t, i) => Math.abs(t - ticks[i]))) : most;
  if (most >= 1e6 || (most < 1e-3 && most > 0)) {
    let digits = 3; // of which powers show all but one
    while (
      digits < 8 &&
      ticks.some((t) => Math.abs(Number(t.toPrecision(digits - 1)) - t) > 0.01 * step)
    )
      digits++;
    return (v) => TC.number(v, digits);
  }
  const decimals = Math.max(
    0,
    Math.min(
      8,
      -Math.floor(Math.log10(step || 1) + 1e-9) +
        (String(Number((step / 10 ** Math.floor(Math.log10(step || 1))).toPrecision(3))) === "2.5"
          ? 1
          : 0),
    ),
  );
  return (v) => v.toFixed(decimals).replace("-", "−");
};

TC.Plot = class {
  // {width, height, x: [lo, hi], y: [lo, hi], xlog, ylog, xlabel, ylabel, margin, label}
  constructor(o) {
    Object.assign(
      this,
      {
        margin: { left: 62, right: 14, top: 12, bottom: 44 },
        xlog: false,
        ylog: false,
        height: 260,
      },
      o,
    );
    this.svg = TC.svgNode("svg", {
      width: this.width,
      height: this.height,
      viewBox: `0 0 ${this.width} ${this.height}`,
      role: "img",
      "aria-label": o.label || o.ylabel || "",
    });
    const m = this.margin;
    this.left = m.left;
    this.right = this.width - m.right;
    this.top = m.top;
    this.bottom = this.height - m.bottom;
    const id = `clip${(TC.Plot.count = (TC.Plot.count || 0) + 1)}`;
    this.svg.append(
      TC.svgNode(
        "clipPath",
        { id },
        TC.svgNode("rect", {
          x: this.left - 4,
          y: this.top - 4,
          width: Math.max(0, this.right - this.left + 8),
          height: Math.max(0, this.bottom - this.top + 8),
        }),
      ),
    );
    this.back = this.svg.appendChild(TC.svgNode("g"));
    this.inner = this.svg.appendChild(TC.svgNode("g", { "clip-path": `url(#${id})` }));
    this.over = this.svg.appendChild(TC.svgNode("g"));
    if (!o.bare) this.axes();
  }
  static map(v, [lo, hi], a, b, log) {
    if (log) {
      v = Math.log(v);
      lo = Math.log(lo);
      hi = Math.log(hi);
    }
    return hi === lo ? (a + b) / 2 : a + ((v - lo) / (hi - lo)) * (b - a);
  }
  px(v) {
    return TC.Plot.map(v, this.x, this.left, this.right, this.xlog);
  }
  py(v) {
    return TC.Plot.map(v, this.y, this.bottom, this.top, this.ylog);
  }
  ix(p) {
    return this.x[0] + ((p - this.left) / (this.right - this.left)) * (this.x[1] - this.x[0]);
  }
  iy(p) {
    return this.y[0] + ((p - this.bottom) / (this.top - this.bottom)) * (this.y[1] - this.y[0]);
  }
  axes() {
    const g = this.back;
    const text = (x, y, s, anchor, extra = {}) =>
      g.append(TC.svgNode("text", { x, y, "text-anchor": anchor, ...extra }, s));
    const many = Math.max(2, Math.floor((this.right - this.left) / 80));
    const tall = Math.max(2, Math.floor((this.bottom - this.top) / 38));
    const xt =
      this.xticks || (this.xlog ? TC.logTicks(...this.x, many) : TC.ticks(...this.x, many));
    const yt = this.ylog ? TC.logTicks(...this.y, tall) : TC.ticks(...this.y, tall);
    const xs = this.xlog ? (v) => TC.number(v, 3) : TC.tickText(xt);
    const ys = this.ylog ? (v) => TC.number(v, 3) : TC.tickText(yt);
    for (const v of yt) {
      const y = this.py(v);
      g.append(
        TC.svgNode("line", {
          x1: this.left,
          x2: this.right,
          y1: y,
          y2: y,
          class: v === 0 ? "zero" : "grid",
        }),
      );
      text(this.left - 7, y + 4, ys(v), "end");
    }
    let last = -Infinity;
    for (const v of this.xnone ? [] : xt) {
      const x = this.px(v);
      const s = this.xtext ? this.xtext(v) : xs(v);
      g.append(
        TC.svgNode("line", { x1: x, x2: x, y1: this.bottom, y2: this.bottom + 4, class: "axis" }),
      );
      if (x - last < 4 + 7 * s.length) continue;
      last = x;
      text(x, this.bottom + 17, s, "middle");
    }
    g.append(
      TC.svgNode("path", {
        d: `M${this.left},${this.top}V${this.bottom}H${this.right}`,
        class: "axis",
      }),
    );
    if (this.xlabel) text((this.left + this.right) / 2, this.bottom + 36, this.xlabel, "middle");
    if (this.ylabel) {
      // a name longer than the axis stands whole in the title above
      const y = (this.top + this.bottom) / 2;
      const unit = / \[[^\]]*\]$/.exec(this.ylabel)?.[0] ?? "";
      const fits = Math.floor((this.bottom - this.top) / 6);
      const cut = this.ylabel.slice(0, fits - unit.length - 1).trimEnd();
      text(11, y, this.ylabel.length > fits ? `${cut}…${unit}` : this.ylabel, "middle", {
        transform: `rotate(-90 11 ${y})`,
      });
    }
  }
  line(xs, ys, attrs = {}) {
    let d = "";
    let pen = false;
    for (let i = 0; i < xs.length; i++) {
      if (!Number.isFinite(ys[i]) || !Number.isFinite(xs[i])) {
        pen = false;
        continue;
      }
      d += `${pen ? "L" : "M"}${this.px(xs[i]).toFixed(2)},${this.py(ys[i]).toFixed(2)}`;
      pen = true;
    }
    return this.inner.appendChild(
      TC.svgNode("path", {
        d,
        fill: "none",
        "stroke-width": 2,
        "stroke-linejoin": "round",
        ...attrs,
      }),
    );
  }
  // Values constant between edges: edges has one entry more than values.
  steps(edges, values, attrs = {}) {
    const xs = [];
    const ys = [];
    for (let i = 0; i < values.length; i++) {
      xs.push(edges[i], edges[i + 1]);
      ys.push(values[i], values[i]);
    }
    return this.line(xs, ys, { "stroke-linejoin": "miter", ...attrs });
  }
  dot(x, y, attrs = {}, title) {
    const node = TC.svgNode("circle", { cx: this.px(x), cy: this.py(y), r: 4, ...attrs });
    if (title) node.append(TC.svgNode("title", {}, title));
    return this.over.appendChild(node);
  }
  text(px, py, s, attrs = {}) {
    return this.over.appendChild(TC.svgNode("text", { x: px, y: py, class: "halo", ...attrs }, s));
  }
  vertical(x, attrs = {}) {
    return this.inner.appendChild(
      TC.svgNode("line", {
        x1: this.px(x),
        x2: this.px(x),
        y1: this.top,
        y2: this.bottom,
        stroke: "var(--soft)",
        ...attrs,
      }),
    );
  }
};

TC.pad = function ([lo, hi], part = 0.06, log = false) {
  if (log) {
    const f = (hi / lo || 10) ** part;
    return hi > lo ? [lo / f, hi * f] : [lo / 2, hi * 2];
  }
  const size = Math.max(Math.abs(lo), Math.abs(hi));
  const span = hi - lo > 1e-12 * size ? hi - lo : size || 1; // what differs by rounding is one value
  return [lo - part * span, hi + part * span];
};

// Blue to yellow, told apart with every kind of colour vision and in grey (after cividis).
TC.CIVIDIS = [
  [0, 34, 78],
  [26, 56, 111],
  [67, 78, 108],
  [99, 101, 111],
  [128, 124, 120],
  [159, 149, 117],
  [191, 176, 105],
  [226, 205, 85],
  [254, 232, 56],
];
// Light to dark: dark lines and letters stay readable on most of it.
TC.HEAT = [
  [255, 255, 204],
  [255, 237, 160],
  [254, 217, 118],
  [254, 178, 76],
  [253, 141, 60],
  [252, 78, 42],
  [227, 26, 28],
  [177, 0, 38],
];
TC.colour = function (t, stops = TC.CIVIDIS) {
  const x = Math.min(1, Math.max(0, t)) * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(x));
  const f = x - i;
  return stops[i].map((c, k) => Math.round(c + f * (stops[i + 1][k] - c)));
};
TC.css = ([r, g, b]) => `rgb(${r},${g},${b})`;
TC.dark = ([r, g, b]) => 0.3 * r + 0.59 * g + 0.11 * b < 125;
TC.DASHES = ["", "7 4", "2 3", "9 3 2 3", "12 4", "4 2"];
TC.series = (i) => ({
  stroke: `var(--c${(i % 7) + 1})`,
  "stroke-dasharray": TC.DASHES[Math.floor(i / 7) % TC.DASHES.length] || TC.DASHES[i % 6],
});
TC.SHAPES = ["circle", "square", "triangle", "diamond", "cross"];
TC.marker = function (shape, x, y, r, attrs = {}) {
  const d = {
    circle: `M${x - r},${y}a${r},${r} 0 1 0 ${2 * r},0a${r},${r} 0 1 0 ${-2 * r},0Z`,
    square: `M${x - r},${y - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
    triangle: `M${x},${y - 1.2 * r}L${x + 1.1 * r},${y + 0.9 * r}H${x - 1.1 * r}Z`,
    diamond: `M${x},${y - 1.3 * r}L${x + 1.3 * r},${y}L${x},${y + 1.3 * r}L${x - 1.3 * r},${y}Z`,
    cross: `M${x - r},${y - r}L${x + r},${y + r}M${x - r},${y + r}L${x + r},${y - r}`,
  };
  return TC.svgNode("path", { d: d[shape], ...attrs });
};
TC.CSV = function (header, rows) {
  const cell = (v) =>
    typeof v === "number"
      ? Number.isFinite(v)
        ? String(v)
        : Number.isNaN(v)
          ? ""
          : v > 0
            ? "inf"
            : "-inf"
      : /[",\n]/.test(String(v))
        ? `"${String(v).replace(/"/g, '""')}"`
        : String(v);
  return [header, ...rows].map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
};
TC.save = function (name, text, type = "text/csv") {
  const link = TC.el("a", {
    download: name,
    href: URL.createObjectURL(new Blob([text], { type })),
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
