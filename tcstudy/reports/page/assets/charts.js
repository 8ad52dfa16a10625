// Small charts in SVG: scales, axes, marks.
// Colours come from the style sheet, so that dark mode and print follow.
TC.withAttributes = function (node, attrs, children) {
  for (const key in attrs) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), attrs[key]);
    else if (attrs[key] !== undefined && attrs[key] !== null && attrs[key] !== false)
      node.setAttribute(key, attrs[key] === true ? "" : attrs[key]);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
};
TC.svgNode = (tag, attrs = {}, ...children) =>
  TC.withAttributes(document.createElementNS("http://www.w3.org/2000/svg", tag), attrs, children);
TC.el = (tag, attrs = {}, ...children) =>
  TC.withAttributes(document.createElement(tag), attrs, children);

TC.ticks = function (low, high, count) {
  const span = high - low || Math.abs(high) || 1;
  const roughStep = span / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(roughStep));
  const step = [1, 2, 2.5, 5, 10].find((factor) => factor * power >= roughStep) * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor((high + 1e-9 * span) / step);
  const ticks = [];
  for (let multiple = first; multiple <= last && ticks.length <= 4 * count; multiple++)
    ticks.push(multiple * step || 0);
  return ticks.length ? ticks : [low];
};
TC.logTicks = function (low, high, count) {
  const firstPower = Math.floor(Math.log10(low) + 1e-9);
  const lastPower = Math.ceil(Math.log10(high) - 1e-9);
  const powerStep = Math.max(1, Math.ceil((lastPower - firstPower) / Math.max(1, count)));
  for (const factors of [[1], [1, 2, 5], [1, 1.5, 2, 3, 5, 7]]) {
    const ticks = [];
    for (let power = firstPower; power <= lastPower; power += factors.length > 1 ? 1 : powerStep)
      ticks.push(
        ...factors
          .map((factor) => factor * 10 ** power)
          .filter((tick) => tick >= low * 0.999 && tick <= high * 1.001),
      );
    if (ticks.length > 2) return ticks;
  }
  return [low, high];
};
TC.tickText = function (ticks) {
  const largest = Math.max(...ticks.map(Math.abs));
  const step =
    ticks.length > 1
      ? Math.min(...ticks.slice(1).map((tick, i) => Math.abs(tick - ticks[i])))
      : largest;
  if (largest >= 1e6 || (largest < 1e-3 && largest > 0)) {
    let digits = 3; // powers of ten show one digit less
    while (
      digits < 8 &&
      ticks.some((tick) => Math.abs(Number(tick.toPrecision(digits - 1)) - tick) > 0.01 * step)
    )
      digits++;
    return (value) => TC.number(value, digits);
  }
  const power = Math.log10(step || 1);
  const leadingDigits = Number((step / 10 ** Math.floor(power)).toPrecision(3));
  const needed = -Math.floor(power + 1e-9) + (leadingDigits === 2.5 ? 1 : 0);
  const decimals = Math.max(0, Math.min(8, needed));
  return (value) => value.toFixed(decimals).replace("-", "−");
};

TC.Plot = class {
  // {width, height, x: [lo, hi], y: [lo, hi], xlog, ylog, xlabel, ylabel, margin, label}
  constructor(options) {
    Object.assign(
      this,
      {
        margin: { left: 62, right: 14, top: 12, bottom: 44 },
        xlog: false,
        ylog: false,
        height: 260,
      },
      options,
    );
    this.svg = TC.svgNode("svg", {
      width: this.width,
      height: this.height,
      viewBox: `0 0 ${this.width} ${this.height}`,
      role: "img",
      "aria-label": options.label || options.ylabel || "",
    });
    const margin = this.margin;
    this.left = margin.left;
    this.right = this.width - margin.right;
    this.top = margin.top;
    this.bottom = this.height - margin.bottom;
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
    if (!options.bare) this.axes();
  }
  static map(value, [low, high], start, end, log) {
    if (log) {
      value = Math.log(value);
      low = Math.log(low);
      high = Math.log(high);
    }
    return high === low
      ? (start + end) / 2
      : start + ((value - low) / (high - low)) * (end - start);
  }
  px(value) {
    return TC.Plot.map(value, this.x, this.left, this.right, this.xlog);
  }
  py(value) {
    return TC.Plot.map(value, this.y, this.bottom, this.top, this.ylog);
  }
  ix(pixel) {
    return this.x[0] + ((pixel - this.left) / (this.right - this.left)) * (this.x[1] - this.x[0]);
  }
  iy(pixel) {
    return this.y[0] + ((pixel - this.bottom) / (this.top - this.bottom)) * (this.y[1] - this.y[0]);
  }
  axes() {
    const group = this.back;
    const text = (x, y, label, anchor, extra = {}) =>
      group.append(TC.svgNode("text", { x, y, "text-anchor": anchor, ...extra }, label));
    const xCount = Math.max(2, Math.floor((this.right - this.left) / 80));
    const yCount = Math.max(2, Math.floor((this.bottom - this.top) / 38));
    const xTicks =
      this.xticks || (this.xlog ? TC.logTicks(...this.x, xCount) : TC.ticks(...this.x, xCount));
    const yTicks = this.ylog ? TC.logTicks(...this.y, yCount) : TC.ticks(...this.y, yCount);
    const xText = this.xlog ? (value) => TC.number(value, 3) : TC.tickText(xTicks);
    const yText = this.ylog ? (value) => TC.number(value, 3) : TC.tickText(yTicks);
    for (const value of yTicks) {
      const y = this.py(value);
      group.append(
        TC.svgNode("line", {
          x1: this.left,
          x2: this.right,
          y1: y,
          y2: y,
          class: value === 0 ? "zero" : "grid",
        }),
      );
      text(this.left - 7, y + 4, yText(value), "end");
    }
    let lastLabelled = -Infinity;
    for (const value of this.xnone ? [] : xTicks) {
      const x = this.px(value);
      const label = this.xtext ? this.xtext(value) : xText(value);
      group.append(
        TC.svgNode("line", { x1: x, x2: x, y1: this.bottom, y2: this.bottom + 4, class: "axis" }),
      );
      if (x - lastLabelled < 4 + 7 * label.length) continue;
      lastLabelled = x;
      text(x, this.bottom + 17, label, "middle");
    }
    group.append(
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
      const maxLetters = Math.floor((this.bottom - this.top) / 6);
      const shortened = this.ylabel.slice(0, maxLetters - unit.length - 1).trimEnd();
      text(
        11,
        y,
        this.ylabel.length > maxLetters ? `${shortened}…${unit}` : this.ylabel,
        "middle",
        {
          transform: `rotate(-90 11 ${y})`,
        },
      );
    }
  }
  line(xs, ys, attrs = {}) {
    let path = "";
    let isPenDown = false;
    for (let index = 0; index < xs.length; index++) {
      if (!Number.isFinite(ys[index]) || !Number.isFinite(xs[index])) {
        isPenDown = false;
        continue;
      }
      const x = this.px(xs[index]).toFixed(2);
      const y = this.py(ys[index]).toFixed(2);
      path += `${isPenDown ? "L" : "M"}${x},${y}`;
      isPenDown = true;
    }
    return this.inner.appendChild(
      TC.svgNode("path", {
        d: path,
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
    for (let index = 0; index < values.length; index++) {
      xs.push(edges[index], edges[index + 1]);
      ys.push(values[index], values[index]);
    }
    return this.line(xs, ys, { "stroke-linejoin": "miter", ...attrs });
  }
  dot(x, y, attrs = {}, title) {
    const node = TC.svgNode("circle", { cx: this.px(x), cy: this.py(y), r: 4, ...attrs });
    if (title) node.append(TC.svgNode("title", {}, title));
    return this.over.appendChild(node);
  }
  text(px, py, content, attrs = {}) {
    return this.over.appendChild(
      TC.svgNode("text", { x: px, y: py, class: "halo", ...attrs }, content),
    );
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

TC.pad = function ([low, high], share = 0.06, log = false) {
  if (log) {
    const factor = (high / low || 10) ** share;
    return high > low ? [low / factor, high * factor] : [low / 2, high * 2];
  }
  const size = Math.max(Math.abs(low), Math.abs(high));
  // values that differ by rounding are one value
  const span = high - low > 1e-12 * size ? high - low : size || 1;
  return [low - share * span, high + share * span];
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
TC.colour = function (fraction, stops = TC.CIVIDIS) {
  const position = Math.min(1, Math.max(0, fraction)) * (stops.length - 1);
  const stop = Math.min(stops.length - 2, Math.floor(position));
  const weight = position - stop;
  return stops[stop].map((channel, channelIndex) =>
    Math.round(channel + weight * (stops[stop + 1][channelIndex] - channel)),
  );
};
TC.css = ([r, g, b]) => `rgb(${r},${g},${b})`;
TC.dark = ([r, g, b]) => 0.3 * r + 0.59 * g + 0.11 * b < 125;
TC.DASHES = ["", "7 4", "2 3", "9 3 2 3", "12 4", "4 2"];
TC.series = (index) => ({
  stroke: `var(--c${(index % 7) + 1})`,
  "stroke-dasharray": TC.DASHES[Math.floor(index / 7) % TC.DASHES.length] || TC.DASHES[index % 6],
});
TC.SHAPES = ["circle", "square", "triangle", "diamond", "cross"];
TC.marker = function (shape, x, y, r, attrs = {}) {
  const paths = {
    circle: `M${x - r},${y}a${r},${r} 0 1 0 ${2 * r},0a${r},${r} 0 1 0 ${-2 * r},0Z`,
    square: `M${x - r},${y - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
    triangle: `M${x},${y - 1.2 * r}L${x + 1.1 * r},${y + 0.9 * r}H${x - 1.1 * r}Z`,
    diamond: `M${x},${y - 1.3 * r}L${x + 1.3 * r},${y}L${x},${y + 1.3 * r}L${x - 1.3 * r},${y}Z`,
    cross: `M${x - r},${y - r}L${x + r},${y + r}M${x - r},${y + r}L${x + r},${y - r}`,
  };
  return TC.svgNode("path", { d: paths[shape], ...attrs });
};
TC.CSV = function (header, rows) {
  const cellText = (value) => {
    if (Number.isNaN(value)) return "";
    if (value === Infinity) return "inf";
    if (value === -Infinity) return "-inf";
    const text = String(value);
    return /[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  return [header, ...rows].map((row) => row.map(cellText).join(",")).join("\r\n") + "\r\n";
};
TC.save = function (name, text, type = "text/csv") {
  const link = TC.el("a", {
    download: name,
    href: URL.createObjectURL(new Blob([text], { type })),
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
