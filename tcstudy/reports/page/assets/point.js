// One point: body, slip and friction along the contact line, law with operating points, energies.
// What a contact node does, by the number that the data have; the words are those of the data.
TC.STATES = ["--body", "--c6", "--c5", "--c2", "--c4"];
TC.MOVES = ["--body", "--c6", "--c5", "--c2"]; // of a step of a history
TC.stateOf = (line, k) => {
  const words = line.moves || TC.data.states;
  const colours = line.moves ? TC.MOVES : TC.STATES;
  return { name: words[k] || "not known", colour: k >= 0 ? `var(${colours[k]})` : "none" };
};
TC.ROLES = {
  contact: { words: "contact", stroke: "var(--c1)", "stroke-width": 4 },
  clamped: { words: "held", stroke: "var(--ink)", "stroke-width": 4 },
  symmetry: {
    words: "symmetry",
    stroke: "var(--ink)",
    "stroke-width": 2,
    "stroke-dasharray": "9 3 2 3",
  },
  rigid: { words: "rigid", stroke: "var(--soft)", "stroke-width": 5 },
  convection: {
    words: "convection",
    stroke: "var(--c3)",
    "stroke-width": 2.5,
    "stroke-dasharray": "7 4",
  },
  traction: {
    words: "traction",
    stroke: "var(--c4)",
    "stroke-width": 2.5,
    "stroke-dasharray": "2 3",
  },
  free: { words: "free", stroke: "var(--soft)", "stroke-width": 1.2 },
};
TC.point = {
  // What the points of the geometry of point p share: outline, mesh and fields, contact lines.
  home: (p) => (TC.data.homes ? TC.data.homes[TC.data.run.home[p]] || {} : TC.data),
  // The number of a point among those of its geometry.
  own(p) {
    const r = TC.data.run;
    if (!TC.data.homes) return p;
    if (!r.own) {
      const seen = {};
      r.own = r.home.map((g) => (seen[g] = (seen[g] ?? -1) + 1));
    }
    return r.own[p];
  },
  get here() {
    return TC.point.home(TC.data.run && TC.state.at ? TC.run.flat(TC.state.at) : 0);
  },
  line(p, level) {
    const lines = TC.point.home(p).lines || {};
    return lines[String(level)] || lines[Object.keys(lines).sort((a, b) => b - a)[0]];
  },
  draw(host) {
    const s = TC.state;
    const p = TC.run.flat(s.at);
    const level = s.level;
    const d = TC.point.home(p);
    const r = TC.data.run;
    const line = TC.point.line(p, level);
    const proof = TC.run.proof(p, level);
    const reason = r.reasons[r.reason[p * r.nlevels + level]];
    const head = TC.el(
      "p",
      {},
      TC.el("b", {}, TC.run.words(s.at)),
      ` on level ${level}: `,
      TC.el(
        "span",
        {
          class: `badge ${proof === "failed" ? "bad" : proof === "nothing" || proof === "local" ? "" : "good"}`,
        },
        TC.data.proofs[proof],
      ),
      reason && proof === "failed" ? TC.el("span", { class: "bad" }, reason) : null,
    );
    const buttons = TC.el(
      "div",
      { class: "controls noprint" },
      TC.el(
        "button",
        {
          "aria-pressed": s.vs ? "true" : "false",
          title: "keep this point and compare others with it (c)",
          "aria-label": "compare",
          onclick: () => TC.set({ vs: s.vs ? null : s.at.slice() }),
        },
        s.vs ? "stop comparing" : "compare with …",
      ),
      s.vs
        ? TC.el(
            "button",
            { "aria-label": "swap", onclick: () => TC.set({ vs: s.at, at: s.vs }) },
            "swap",
          )
        : null,
      s.vs
        ? TC.el(
            "span",
            { class: "note" },
            TC.run.flat(s.vs) === p
              ? "kept; now choose another point"
              : `dashed: ${TC.run.words(s.vs)}`,
          )
        : null,
      d.body
        ? TC.el(
            "label",
            {},
            TC.el("span", {}, "deformation: ", TC.el("output", { id: "deform-text" })),
            TC.el("input", {
              type: "range",
              min: 0,
              max: 3,
              step: 0.05,
              value: s.deform,
              "aria-label": "deformation",
              oninput: (e) => {
                s.deform = Number(e.target.value);
                TC.writeState();
                TC.point.body(p);
              },
            }),
          )
        : null,
    );
    const left = (TC.point.left = TC.panel());
    const right = TC.panel();
    const vs = s.vs && TC.run.flat(s.vs) !== p ? TC.run.flat(s.vs) : null;
    TC.fill(host, head, buttons, TC.el("div", { class: "columns wide" }, left, right));
    const frame = line && TC.point.frame(line, TC.width(left));
    if (frame && frame.shape) TC.point.bodyPanel(left, p, line, frame);
    if (line && (proof !== "failed" || Number.isFinite(TC.row(line.u_T, TC.point.own(p))[0]))) {
      const cases = [p, vs]
        .filter((k) => k !== null && TC.point.line(k, level))
        .map((k) => TC.point.contact(TC.point.line(k, level), k));
      const shown = TC.point.equilibrium(line, p);
      if (shown !== null) cases[0] = { ...cases[0], ...TC.point.state(line, shown) };
      TC.point.profiles(
        left,
        line,
        cases,
        frame,
        d.lines[String(level)] !== line
          ? `level ${r.nlevels - 1} (the page holds no contact line of level ${level})`
          : "",
      );
      TC.point.law(right, line, cases, p, vs);
    } else if (!line && proof !== "failed")
      left.append(TC.note("The page was made without contact lines; the file has them."));
    if (line && line.every) TC.point.equilibria(right, line, p);
    TC.point.energies(right, p, level);
    TC.point.table(right, p, vs, level);
  },
  // Slip, friction and state at every contact node of a point, with the line that they are on.
  contact(line, p) {
    const q = TC.point.own(p);
    const m = line.x.length;
    return {
      line,
      u: TC.row(line.u_T, q),
      held: line.held_u_T ? TC.row(line.held_u_T, q) : null,
      xi: TC.row(line.xi, q),
      N: line.N && TC.row(line.N, q),
      state: line.state.subarray(q * m, (q + 1) * m),
    };
  },
  // Of points whose equilibria are all stored: the number of the one chosen among those of the line, null for the solution.
  equilibrium(line, p) {
    if (!line.every) return null;
    const q = TC.point.own(p);
    const first = line.every.first[q];
    const k = Number(TC.state.eq) || 0;
    return k < line.every.first[q + 1] - first ? first + k : null;
  },
  state(line, k) {
    const m = line.x.length;
    const e = line.every;
    return {
      u: TC.row(e.u_T, k),
      xi: TC.row(e.xi, k),
      N: null,
      state: e.state.subarray(k * m, (k + 1) * m),
    };
  },
  equilibria(host, line, p) {
    const q = TC.point.own(p);
    const e = line.every;
    const first = e.first[q];
    const count = e.first[q + 1] - first;
    const all = TC.run.flag("complete", p, TC.state.level);
    const units = TC.data.run.numbers.energy.units;
    const chosen = TC.point.equilibrium(line, p);
    const told =
      all === 1
        ? `${count} of ${count} equilibria, proved`
        : all === 2
          ? `${count} equilibria of the law's polygon`
          : `at least ${count} equilibria`;
    host.append(
      TC.h3(told),
      TC.note("by energy; a click shows the state along the contact line and on the law"),
      TC.el(
        "div",
        { class: "minima" },
        [...Array(Math.min(count, 100)).keys()].map((k) =>
          TC.el(
            "button",
            {
              "aria-label": `equilibrium ${k}`,
              "aria-pressed": first + k === chosen ? "true" : "false",
              onclick: () => TC.set({ eq: k }),
            },
            `${k ? "+ " + TC.quantity(e.energy[first + k] - e.energy[first], units, 4) : TC.quantity(e.energy[first], units, 6)}, ${e.stable[first + k] ? "stable" : "unstable"}`,
          ),
        ),
      ),
    );
  },
  // u_T at a held end of a part: as stored, or 0 where every clamped edge is at rest; NaN where it is not known.
  heldSlip: (c, part, e) =>
    !part.held[e]
      ? NaN
      : c.held && part.ends[e] >= 0
        ? c.held[part.ends[e]]
        : c.line.rest
          ? 0
          : NaN,
  // The laws of a point: one, or one of every edge.
  lawsOf: (p) =>
    TC.data.laws ? [TC.data.laws.index[p]].flat().map((k) => TC.data.laws.laws[k]) : [null],
  strength: (line, p) =>
    line.of_law ? TC.row(line.strengths, line.strength_of[TC.point.own(p)]) : null,
  // Where things stand: drawn body in pixels, and whether the contact line runs along x so that all share one axis.
  frame(line, width) {
    const d = TC.point.here;
    const xs = [];
    const ys = [];
    for (const e of d.outline || [])
      for (const [x, y] of e.line) {
        xs.push(x);
        ys.push(y);
      }
    if (d.body) {
      xs.push(...TC.range(d.body.x));
      ys.push(...TC.range(d.body.y));
    }
    const shape = xs.length > 0;
    const [y0, y1] = TC.range(line.y);
    const bx = shape ? TC.range(xs) : TC.range(line.x);
    const by = shape ? TC.range(ys) : [y0, y1];
    const along = y1 - y0 <= 1e-9 * (bx[1] - bx[0]);
    const margin = { left: 66, right: 100 };
    const wide = width - margin.left - margin.right;
    const per = Math.max((bx[1] - bx[0]) / wide, (by[1] - by[0]) / 340);
    const scale = TC.scale(bx, line.u_T_units);
    const used = (bx[1] - bx[0]) / per;
    return {
      shape,
      width,
      margin,
      bx,
      by,
      per,
      along,
      scale,
      used,
      top: 34,
      high: (by[1] - by[0]) / per,
    };
  },
  bodyPanel(host, p, line, frame) {
    const extra = 26;
    const width = frame.width;
    const height = Math.ceil(frame.high + 2 * frame.top + extra);
    const d = TC.point.here;
    const canvas = TC.el("canvas", {
      style: `width:${width}px;height:${height}px`,
      role: "img",
      "aria-label": "the body",
    });
    const svg = TC.svgNode("svg", {
      width,
      height,
      role: "img",
      "aria-label": "the body with the roles of its edges",
    });
    const ratio = Math.min(3, window.devicePixelRatio || 1);
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const title = TC.h3(
      d.body && d.body.theta
        ? `Temperature θ [${TC.unit(d.body.theta_units) || "1"}] and deformation`
        : d.body
          ? "Deformation"
          : "The body",
    );
    host.append(
      title,
      TC.el("div", { class: "stack", style: `height:${height}px` }, canvas, svg),
      TC.point.roleKey(),
    );
    TC.point.panel = { canvas, svg, frame, line, ratio, height };
    TC.point.body(p);
  },
  roleKey() {
    const used = [...new Set((TC.point.here.outline || []).map((e) => e.role))];
    if (!used.length) return TC.el("span");
    const roles = Object.keys(TC.ROLES)
      .filter((r) => used.includes(r))
      .map((role) => {
        const { words, ...look } = TC.ROLES[role];
        return TC.entry(28, 10, [TC.dash(28, 5, look)], words);
      });
    const heater = TC.svgNode("rect", {
      x: 1,
      y: 1,
      width: 26,
      height: 10,
      fill: "none",
      stroke: "var(--bad)",
      "stroke-width": 1.5,
      "stroke-dasharray": "4 3",
    });
    return TC.legend(
      ...roles,
      (TC.point.here.sources || []).length ? TC.entry(28, 12, [heater], "heated") : "",
    );
  },
  toPx(frame, x, y) {
    return [
      frame.margin.left + (x - frame.bx[0]) / frame.per,
      frame.top + frame.high - (y - frame.by[0]) / frame.per,
    ];
  },
  body(p) {
    const { canvas, svg, frame, line, ratio } = TC.point.panel;
    const b = TC.point.here.body;
    const g = canvas.getContext("2d");
    const factor = b && TC.run.flag("status", p, b.level) === 1 ? b.factor * TC.state.deform : 0;
    const text = document.getElementById("deform-text");
    if (text) text.textContent = `× ${TC.number(factor, 2)}`;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, canvas.width, canvas.height);
    const over = [];
    if (b) TC.point.fillBody(g, p, factor, frame, over);
    else TC.point.fillOutline(over, frame);
    TC.point.names(over, frame, b ? TC.point.moved(p, factor) : null);
    svg.replaceChildren(...over);
  },
  fillBody(g, p, factor, frame, over) {
    const b = TC.point.here.body;
    const n = b.x.length;
    const ux = TC.field(b.u_x, TC.point.own(p));
    const uy = TC.field(b.u_y, TC.point.own(p));
    const X = new Float64Array(n);
    const Y = new Float64Array(n);
    for (let i = 0; i < n; i++)
      [X[i], Y[i]] = TC.point.toPx(frame, b.x[i] + factor * ux[i], b.y[i] + factor * uy[i]);
    const solved = TC.run.flag("status", p, b.level) === 1; // a failed point has no fields
    if (!solved)
      over.push(
        TC.svgNode(
          "text",
          { x: frame.margin.left, y: 16 },
          "no solution, so neither temperature nor deformation",
        ),
      );
    const theta = b.theta && solved ? TC.field(b.theta, TC.point.own(p)) : null;
    const [lo, hi] = theta ? TC.range(theta) : [0, 0];
    const even = !theta || hi - lo <= 2e-3 * Math.max(Math.abs(lo), Math.abs(hi));
    const style = getComputedStyle(document.documentElement);
    const levels = even ? [] : TC.ticks(lo, hi, 11);
    const colour = (t) => TC.css(TC.colour(t, TC.HEAT));
    const tri = b.triangle;
    if (even) {
      g.fillStyle = theta ? colour(0.3) : style.getPropertyValue("--body");
      g.strokeStyle = g.fillStyle;
      g.lineWidth = 0.6;
      g.beginPath();
      for (let t = 0; t < tri.length; t += 3) {
        g.moveTo(X[tri[t]], Y[tri[t]]);
        g.lineTo(X[tri[t + 1]], Y[tri[t + 1]]);
        g.lineTo(X[tri[t + 2]], Y[tri[t + 2]]);
        g.closePath();
      }
      g.fill();
      g.stroke();
    } else {
      const step = levels[1] - levels[0];
      const first = Math.floor(lo / step) * step;
      const count = Math.max(1, Math.ceil((hi - first) / step - 1e-9));
      const bands = [...Array(count)].map(() => []);
      for (let t = 0; t < tri.length; t += 3) {
        const corners = [0, 1, 2].map((k) => {
          const i = tri[t + k];
          return [X[i], Y[i], (theta[i] - first) / step];
        });
        const a = Math.max(0, Math.floor(Math.min(...corners.map((c) => c[2]))));
        const z = Math.min(count - 1, Math.floor(Math.max(...corners.map((c) => c[2]))));
        for (let k = a; k <= z; k++) {
          const poly = a === z ? corners : TC.point.clip(TC.point.clip(corners, k, 1), k + 1, -1);
          if (poly.length > 2) bands[k].push(poly);
        }
      }
      bands.forEach((polys, k) => {
        g.fillStyle = colour((k + 0.5) / count);
        g.strokeStyle = g.fillStyle;
        g.lineWidth = 0.6;
        g.beginPath();
        for (const poly of polys) {
          poly.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
          g.closePath();
        }
        g.fill();
        g.stroke();
      });
      TC.point.heatBar(over, frame, first, step, count, colour);
    }
    if (theta && even)
      over.push(
        TC.svgNode(
          "text",
          { x: frame.margin.left, y: 16 },
          `θ = ${TC.number(0.5 * (lo + hi), 4)} ${TC.unit(b.theta_units)} everywhere`,
        ),
      );
    for (const e of TC.point.here.outline || [])
      over.push(
        TC.point.path(
          e.line.map(([x, y]) => TC.point.toPx(frame, x, y)),
          { fill: "none", stroke: "var(--soft)", "stroke-width": 1, "stroke-dasharray": "4 3" },
        ),
      );
    const edges = b.boundary;
    const byRole = {};
    for (let k = 0; k < edges.length / 2; k++) {
      const known =
        TC.point.here.outline && b.edge[k] >= 0 ? TC.point.here.outline[b.edge[k]].role : "free";
      (byRole[known] = byRole[known] || []).push(
        `M${X[edges[2 * k]].toFixed(1)},${Y[edges[2 * k]].toFixed(1)}L${X[edges[2 * k + 1]].toFixed(1)},${Y[edges[2 * k + 1]].toFixed(1)}`,
      );
    }
    for (const role of Object.keys(TC.ROLES).reverse())
      if (byRole[role]) {
        const { words, ...look } = TC.ROLES[role];
        over.push(
          TC.svgNode("path", {
            d: byRole[role].join(""),
            fill: "none",
            ...look,
            "stroke-dasharray": null,
          }),
        );
      }
    TC.point.heated(over, frame);
  },
  // The part of a polygon [x, y, value] with sign·value ≥ sign·bound.
  clip(poly, bound, sign) {
    const out = [];
    for (let i = 0; i < poly.length; i++) {
      const a = poly[i];
      const b = poly[(i + 1) % poly.length];
      const da = sign * (a[2] - bound);
      const db = sign * (b[2] - bound);
      if (da >= 0) out.push(a);
      if (da * db < 0) {
        const t = da / (da - db);
        out.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), bound]);
      }
    }
    return out;
  },
  heatBar(over, frame, first, step, count, colour) {
    const x = Math.min(frame.width - 44, frame.margin.left + frame.used + 54);
    const h = Math.min(frame.high, 220);
    const y0 = frame.top + (frame.high - h) / 2;
    const each = h / count;
    const text = TC.tickText([...Array(count + 1)].map((_, k) => first + k * step));
    const every = Math.max(1, Math.ceil(14 / each));
    for (let k = 0; k < count; k++)
      over.push(
        TC.svgNode("rect", {
          x,
          y: y0 + h - (k + 1) * each,
          width: 11,
          height: each + 0.5,
          fill: colour((k + 0.5) / count),
        }),
      );
    for (let k = 0; k <= count; k += every)
      over.push(
        TC.svgNode("text", { x: x + 15, y: y0 + h - k * each + 4 }, text(first + k * step)),
      );
  },
  path: (pts, attrs) =>
    TC.svgNode("path", {
      d: pts.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`).join(""),
      ...attrs,
    }),
  fillOutline(over, frame) {
    const d = TC.point.here.outline.map((e) => e.line.map(([x, y]) => TC.point.toPx(frame, x, y)));
    over.push(
      TC.svgNode("path", {
        d: d
          .map((pts, k) =>
            pts
              .map(
                ([x, y], i) =>
                  `${i || (k && Math.hypot(x - d[k - 1][d[k - 1].length - 1][0], y - d[k - 1][d[k - 1].length - 1][1]) < 1e-6) ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`,
              )
              .join(""),
          )
          .join(""),
        fill: "var(--body)",
        "fill-rule": "evenodd",
        stroke: "none",
      }),
    );
    TC.point.here.outline.forEach((e, k) => {
      const { words, ...look } = TC.ROLES[e.role];
      over.push(TC.point.path(d[k], { fill: "none", ...look }));
    });
    TC.point.heated(over, frame);
  },
  heated(over, frame) {
    for (const loop of TC.point.here.sources || [])
      over.push(
        TC.point.path(
          [...loop, loop[0]].map(([x, y]) => TC.point.toPx(frame, x, y)),
          { fill: "none", stroke: "var(--bad)", "stroke-width": 1.5, "stroke-dasharray": "4 3" },
        ),
      );
  },
  // Where the middle of a named edge goes with the deformation, in pixels.
  moved(p, factor) {
    const b = TC.point.here.body;
    const ux = TC.field(b.u_x, TC.point.own(p));
    const uy = TC.field(b.u_y, TC.point.own(p));
    const frame = TC.point.panel.frame;
    return (x, y) => {
      let best = 0;
      let least = Infinity;
      for (const i of b.boundary) {
        const far = (b.x[i] - x) ** 2 + (b.y[i] - y) ** 2;
        if (far < least) {
          least = far;
          best = i;
        }
      }
      return TC.point.toPx(frame, x + factor * ux[best], y + factor * uy[best]);
    };
  },
  // Names of edges, each once, outside its longest piece.
  names(over, frame, moved) {
    const longest = new Map();
    const size = (e) =>
      e.line
        .slice(1)
        .reduce((t, q, i) => t + Math.hypot(q[0] - e.line[i][0], q[1] - e.line[i][1]), 0);
    for (const e of TC.point.here.outline || []) {
      const known = longest.get(e.name);
      if (!known || size(e) > size(known)) longest.set(e.name, e);
    }
    for (const e of longest.values()) {
      const k = Math.floor((e.line.length - 1) / 2);
      const a = e.line[k];
      const b = e.line[k + 1];
      const [ax, ay] = TC.point.toPx(frame, ...a);
      const [bx, by] = TC.point.toPx(frame, ...b);
      const len = Math.hypot(bx - ax, by - ay) || 1;
      const nx = -(by - ay) / len;
      const ny = (bx - ax) / len; // outward for a counter-clockwise outline, y downwards on the screen
      if (e.loop) {
        // a hole's name stands inside the hole
        const all = TC.point.here.outline
          .filter((o) => o.loop === e.loop)
          .flatMap((o) => o.line)
          .map(([x, y]) => TC.point.toPx(frame, x, y));
        const [x0, x1] = TC.range(all.map((q) => q[0]));
        const [y0, y1] = TC.range(all.map((q) => q[1]));
        if (x1 - x0 > 8 * e.name.length)
          over.push(
            TC.svgNode(
              "text",
              { x: (x0 + x1) / 2, y: (y0 + y1) / 2 + 4, class: "soft", "text-anchor": "middle" },
              e.name,
            ),
          );
        continue;
      }
      const middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
      const [ux, uy] = moved ? moved(...middle) : [(ax + bx) / 2, (ay + by) / 2];
      const still = [(ax + bx) / 2, (ay + by) / 2];
      const out = Math.max(0, (ux - still[0]) * nx + (uy - still[1]) * ny);
      const x = still[0] + (13 + out) * nx;
      const y = still[1] + (13 + out) * ny;
      over.push(
        TC.svgNode(
          "text",
          {
            x,
            y: y + 4,
            class: "halo soft",
            "text-anchor": nx > 0.5 ? "start" : nx < -0.5 ? "end" : "middle",
          },
          e.name,
        ),
      );
    }
  },
  // What runs along the contact line, each over the same axis: slip and section force from node to node, friction on segments.
  ALONG: [
    ["u", "slip", "slip u_T", "u_T_units", "var(--c1)"],
    ["xi", "friction", "friction ξ = −S_T", "xi_units", "var(--c2)"],
    ["N", "section force", "section force N", "N_units", "var(--c3)"],
  ],
  profiles(host, line, cases, frame, note) {
    const width = frame.width;
    const by = frame.scale.by;
    const whole = frame.along && frame.shape;
    const margin = {
      left: frame.margin.left,
      right: whole ? width - frame.margin.left - frame.used : 20,
    };
    const sense = (on, part) =>
      frame.along && part.b - part.a > 1 && on.x[part.b - 1] < on.x[part.a] ? -1 : 1;
    const start = (on, i) => (frame.along ? on.x : on.arclength)[i] / by;
    const place = (on, part, s) =>
      start(on, part.a) + (sense(on, part) * (s - on.arclength[part.a])) / by;
    const ends = cases.flatMap(({ line: on }) =>
      on.parts.flatMap((part) => [
        place(on, part, part.cells[0]),
        place(on, part, part.cells[part.cells.length - 1]),
      ]),
    );
    const x = TC.range([...(whole ? frame.bx.map((v) => v / by) : []), ...ends]);
    const rows = TC.point.ALONG.filter(([key]) => cases[0][key]);
    const plots = rows.map(([key, word, title, units, stroke], k) => {
      const last = k === rows.length - 1;
      const values = cases.flatMap((c) =>
        TC.range([...(c[key] || []), ...(key === "u" && c.held ? c.held : [])], []),
      );
      const scale = TC.scale(values, line[units]);
      const y = TC.pad(TC.range([0, ...values.map((v) => v / scale.by)]));
      const room = { ...margin, top: k ? 8 : 20, bottom: last ? 46 : 8 };
      return {
        key,
        word,
        scale,
        stroke,
        plot: new TC.Plot({
          width,
          height: 150 + room.top + room.bottom,
          x,
          y,
          xlabel: last
            ? TC.titled(frame.along ? "x" : "arc length along the contact line", frame.scale)
            : "",
          ylabel: TC.titled(title, scale),
          margin: room,
          xnone: !last,
          label: `${word} along the contact line`,
        }),
      };
    });
    cases.forEach((c, k) => {
      const on = c.line;
      const dash = k ? { "stroke-dasharray": "6 4", opacity: 0.85 } : {};
      for (const part of on.parts) {
        const nodes = [...Array(part.b - part.a).keys()].map((i) => part.a + i);
        const edges = Array.from(part.cells, (s) => place(on, part, s));
        const [a, b] = [edges[0], edges[edges.length - 1]];
        const slip = [0, 1].map((e) => TC.point.heldSlip(c, part, e));
        if (part.closed) {
          edges[0] = start(on, part.a);
          edges.push(edges[0] + b - a);
        }
        for (const { key, scale, stroke, plot } of plots)
          if (c[key]) {
            const at = nodes.map((i) => start(on, i));
            const values = nodes.map((i) => c[key][i] / scale.by);
            const look = { stroke, "stroke-width": 2, ...dash };
            if (part.closed) {
              at.push(b);
              values.push(values[0]);
            }
            if (key === "xi") {
              plot.steps(edges, values, look);
              continue;
            }
            const [first, after] =
              key === "u" ? slip.map((u) => (Number.isFinite(u) ? [u / scale.by] : [])) : [[], []];
            plot.line(
              [...first.map(() => a), ...at, ...after.map(() => b)],
              [...first, ...values, ...after],
              look,
            );
          }
        if (k) continue;
        for (const i of nodes) {
          const [l, r] = [0, 1].map((e) =>
            plots[0].plot.px(place(on, part, part.cells[i - part.a + e])),
          );
          plots[0].plot.over.append(
            TC.svgNode("rect", {
              x: Math.min(l, r),
              y: 4,
              width: Math.abs(r - l) + 0.4,
              height: 9,
              fill: TC.stateOf(on, c.state[i]).colour,
            }),
          );
        }
        for (const { key, scale, plot } of plots)
          for (const e of [0, 1])
            if (part.held[e]) {
              const px = plot.px([a, b][e]);
              const py = plot.py(key === "u" && Number.isFinite(slip[e]) ? slip[e] / scale.by : 0);
              plot.over.append(
                TC.svgNode(
                  "path",
                  {
                    d: `M${px},${py - 8}V${py + 8}M${px},${py - 8}l-5,5M${px},${py - 2}l-5,5M${px},${py + 4}l-5,5`,
                    stroke: "var(--ink)",
                    "stroke-width": 1.5,
                    fill: "none",
                  },
                  TC.svgNode("title", {}, "held end"),
                ),
              );
            }
      }
    });
    const shares = TC.STATES.map(() => 0);
    const total = line.c.reduce((a, b) => a + b, 0);
    for (let i = 0; i < line.c.length; i++) shares[cases[0].state[i]] += line.c[i] / total;
    const key = TC.legend(
      ...shares.map((part, k) => {
        const st = TC.stateOf(line, k);
        return part > 0 ? TC.swatch(st.colour, `${st.name} (${Math.round(100 * part)} %)`) : "";
      }),
      line.parts.some((part) => part.held[0] || part.held[1]) ? "hatched bar: held end" : "",
    );
    TC.point.hover(plots, line, cases[0], (i) => start(line, i));
    host.append(
      TC.h3(
        `${plots.length > 2 ? "Slip, friction and section force" : "Slip and friction"} along ${line.edges.join(", ") || "the contact line"}`,
      ),
      ...plots.map(({ plot }) => plot.svg),
      key,
      note ? TC.note(note) : "",
    );
  },
  // The values at the node under the pointer.
  hover(plots, line, c, pos) {
    const marks = plots.map(({ plot }) =>
      plot.over.appendChild(
        TC.svgNode("line", {
          y1: plot.top,
          y2: plot.bottom,
          stroke: "var(--ink)",
          "stroke-width": 1,
          visibility: "hidden",
          "pointer-events": "none",
        }),
      ),
    );
    const first = plots[0].plot;
    const text = first.text(first.right, 30, "", { "text-anchor": "end", visibility: "hidden" });
    const seen = (word) => [...marks, text].forEach((one) => one.setAttribute("visibility", word));
    for (const { plot } of plots) {
      plot.svg.addEventListener("pointermove", (e) => {
        const v = plot.ix(e.clientX - plot.svg.getBoundingClientRect().left);
        let best = 0;
        for (let i = 1; i < c.u.length; i++)
          if (Math.abs(pos(i) - v) < Math.abs(pos(best) - v)) best = i;
        for (const mark of marks)
          for (const side of ["x1", "x2"]) mark.setAttribute(side, plot.px(pos(best)));
        text.textContent = `${plots.map(({ key, word, scale }) => `${word} ${TC.number(c[key][best] / scale.by)} ${scale.unit}`).join(", ")}, ${TC.stateOf(line, c.state[best]).name}`;
        seen("visible");
      });
      plot.svg.addEventListener("pointerleave", () => seen("hidden"));
    }
  },
  // The law f b(s / g) with the place of every node on it.
  lawPlot(width, title, data, cases, line, f = 1, g = 1) {
    const law = new TC.Law(data.pieces, f, g);
    const us = cases.flatMap((c) => TC.range(c.u));
    const widest = Math.max(...us.map(Math.abs), 0);
    const all = [...us, 0];
    const most = data.reach * g;
    const reach = most > 0 ? Math.min(most, Math.max(3 * widest, 0.2 * most)) : widest || 1;
    const both = Math.min(...all) < -0.02 * widest;
    const lo = Math.min(both ? -0.6 * reach : -0.12 * reach, ...all);
    const hi = Math.max(both && Math.max(...all) < 0.02 * widest ? 0.12 * reach : reach, ...all);
    const [x0, x1] = TC.pad([lo, hi], 0.02);
    const within = [...law.kinks.keys()].filter((k) => law.kinks[k] > x0 && law.kinks[k] < x1);
    const ends = [x0, ...within.map((k) => law.kinks[k]), x1];
    const curves = ends.slice(1).map((to, i) => {
      const from = ends[i];
      const k = law.piece(0.5 * (from + to), 1);
      const n = law.a[k] === 0 ? 1 : 60;
      const s = [...Array(n + 1).keys()].map((j) => from + ((to - from) * j) / n);
      return [s, s.map((v) => law.value(v, k))];
    });
    const bs = [
      0,
      ...curves.flatMap(([, b]) => TC.range(b)),
      ...cases.flatMap((c) => TC.range(c.xi)),
    ];
    const u = TC.scale([lo, hi], line.u_T_units);
    const y = TC.scale(bs, line.xi_units);
    const put = (s, b) => ({
      x: Array.from(s, (v) => v / u.by),
      y: Array.from(b, (v) => v / y.by),
    });
    const items = curves.map(([s, b]) => ({
      kind: "line",
      ...put(s, b),
      colour: "var(--ink)",
      width: 1.6,
    }));
    for (const k of within.filter((i) => law.kind[i] !== 0)) {
      const up = law.kind[k] > 0;
      items.push({
        kind: "line",
        ...put([law.kinks[k], law.kinks[k]], [law.left[k], law.right[k]]),
        colour: up ? "var(--c1)" : "var(--c2)",
        width: up ? 3 : 2,
        dash: up ? "" : "4 3",
      });
    }
    cases.forEach((c, k) =>
      items.push({
        kind: "marks",
        ...put(c.u, c.xi),
        shape: "circle",
        r: 3.2,
        alpha: k ? 0 : 0.55,
        fill: (i) => TC.stateOf(line, c.state[i]).colour,
      }),
    );
    const limits = [[x0 / u.by, x1 / u.by], TC.pad(TC.range(bs.map((v) => v / y.by)), 0.08)];
    return TC.part.panel(
      {
        title,
        labels: [TC.titled("slip u_T", u), TC.titled("ξ", y)],
        log: [false, false],
        limits,
        items,
        high: 270,
      },
      width,
    );
  },
  law(host, line, cases, p, vs) {
    const laws = TC.point.lawsOf(p);
    const strength = TC.point.strength(line, p);
    const units = line.xi_units === "1" ? "1" : "Pa m-1";
    if (!laws[0]) {
      host.append(
        TC.h3("Friction law"),
        TC.note(
          "The page has no laws: the text of the study cannot be read here, or it has too many points.",
        ),
      );
      return;
    }
    laws.forEach((law, k) => {
      const other =
        vs !== null && TC.point.lawsOf(vs)[k] !== law
          ? " (the compared point has another law; its places are drawn all the same)"
          : "";
      const edge = strength && TC.data.laws.edges[k] ? ` of ${TC.data.laws.edges[k]}` : "";
      const scaled = strength && [...strength].some((s) => s > 0 && Math.abs(s - 1) > 1e-4);
      const omega =
        law.omega === Infinity || law.omega === null ? "∞" : TC.quantity(law.omega, units);
      const own = strength ? cases.map((c) => TC.point.onEdge(c, strength, k)) : cases;
      host.append(
        TC.point.lawPlot(
          TC.width(host),
          `Friction law${edge} (${law.name}) and where every node stands on it`,
          law,
          own,
          line,
        ),
        TC.legend(
          `steepest fall ω = ${omega}; thick: up-jump (sticking), dashed: down-jump${scaled ? "; ξ divided by the strength at its node" : ""}${other}`,
        ),
      );
    });
  },
  // The nodes of one edge's law, without gaps in the bond, ξ as the law has it.
  onEdge(c, strength, k) {
    const own = [...c.u.keys()].filter((i) => c.line.of_law[i] === k && strength[i] > 0);
    const pick = (values) => own.map((i) => values[i]);
    return { u: pick(c.u), xi: own.map((i) => c.xi[i] / strength[i]), state: pick(c.state) };
  },
  energies(host, p, level) {
    const r = TC.data.run;
    const e = TC.run.energies(p, level);
    const found = e
      .map((v, k) => ({ v, name: r.starts[k], used: TC.run.flag("start_used", p, level) === k }))
      .filter((o) => Number.isFinite(o.v));
    if (!found.length) return;
    const least = Math.min(...found.map((o) => o.v));
    const size = Math.max(...found.map((o) => Math.abs(o.v))) || 1;
    const units = r.numbers.energy ? r.numbers.energy.units : "1";
    const told = (gap) => (gap <= 1e-9 * size ? "least" : `+ ${TC.quantity(gap, units, 3)}`);
    const rows = found.map((o) => [
      o.name,
      TC.quantity(o.v, units, 5),
      told(o.v - least),
      o.used ? "stored" : "",
    ]);
    host.append(
      TC.h3("Energy of the solution that each start leads to"),
      TC.wide(["start", "energy", "", ""], rows, (k) => (k === 0 || k === 3) && "text"),
      TC.note(
        TC.run.several(p, level)
          ? "Different energies: more than one solution was found."
          : "All starts lead to the same energy.",
      ),
    );
  },
  table(host, p, vs, level) {
    const r = TC.data.run;
    const cell = (name, k) => TC.quantity(TC.run.value(name, k, level), r.numbers[name].units, 5);
    const names = Object.keys(r.numbers).filter(
      (n) => Number.isFinite(TC.run.value(n, p, level)) || TC.run.value(n, p, level) === Infinity,
    );
    const rows = names.map((n) =>
      TC.el(
        "tr",
        {},
        TC.el("th", { title: r.numbers[n].long_name }, TC.symbol(n)),
        TC.el("td", {}, cell(n, p)),
        vs !== null ? TC.el("td", {}, cell(n, vs)) : null,
      ),
    );
    const head =
      vs !== null
        ? TC.el(
            "tr",
            {},
            TC.el("th", {}, ""),
            TC.el("td", {}, TC.el("b", {}, "this point")),
            TC.el("td", {}, TC.el("b", {}, TC.run.words(TC.run.index(vs)))),
          )
        : null;
    host.append(
      TC.el(
        "details",
        { open: vs !== null || (r.asked || []).length > 0 },
        TC.el("summary", {}, "All numbers of this point"),
        TC.el("table", { class: "facts" }, TC.el("tbody", {}, head, rows)),
      ),
    );
  },
};
