// One point: body, slip and friction along the contact line, law with operating points, energies.

// Colours of the states of a contact node, by their numbers in the data, which have the words too.
TC.STATES = ["--body", "--c6", "--c5", "--c2", "--c4"];
TC.MOVES = ["--body", "--c6", "--c5", "--c2"]; // of a step of a history
TC.stateOf = (line, code) => {
  const words = line.moves || TC.data.states;
  const colours = line.moves ? TC.MOVES : TC.STATES;
  return { name: words[code] || "not known", colour: code >= 0 ? `var(${colours[code]})` : "none" };
};
TC.ROLES = {
  contact: { words: "contact", stroke: "var(--c1)", "stroke-width": 4 },
  clamped: { words: "constrained", stroke: "var(--ink)", "stroke-width": 4 },
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
  geometryOf: (point) => (TC.data.homes ? TC.data.homes[TC.data.run.home[point]] || {} : TC.data),
  // The number of a point among those of its geometry.
  indexInGeometry(point) {
    const run = TC.data.run;
    if (!TC.data.homes) return point;
    if (!run.indicesInGeometry) {
      const lastIndex = {};
      run.indicesInGeometry = run.home.map(
        (geometry) => (lastIndex[geometry] = (lastIndex[geometry] ?? -1) + 1),
      );
    }
    return run.indicesInGeometry[point];
  },
  get currentGeometry() {
    return TC.point.geometryOf(TC.data.run && TC.state.at ? TC.run.pointAt(TC.state.at) : 0);
  },
  line(point, level) {
    const lines = TC.point.geometryOf(point).lines || {};
    return (
      lines[String(level)] || lines[Object.keys(lines).sort((first, second) => second - first)[0]]
    );
  },
  // Class of the badge that names the certificate of a solution.
  badge(proof) {
    if (proof === "failed") return "bad";
    return proof === "nothing" || proof === "local" ? "" : "good";
  },
  draw(host) {
    const state = TC.state;
    const point = TC.run.pointAt(state.at);
    const level = state.level;
    const geometry = TC.point.geometryOf(point);
    const run = TC.data.run;
    const line = TC.point.line(point, level);
    const proof = TC.run.proof(point, level);
    const reason = run.reasons[run.reason[point * run.nlevels + level]];
    const heading = TC.el(
      "p",
      {},
      TC.el("b", {}, TC.run.words(state.at)),
      ` on level ${level}: `,
      TC.el(
        "span",
        {
          class: `badge ${TC.point.badge(proof)}`,
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
          "aria-pressed": state.vs ? "true" : "false",
          title: "keep this point and compare others with it (c)",
          "aria-label": "compare",
          onclick: () => TC.set({ vs: state.vs ? null : state.at.slice() }),
        },
        state.vs ? "stop comparing" : "compare with …",
      ),
      state.vs
        ? TC.el(
            "button",
            { "aria-label": "swap", onclick: () => TC.set({ vs: state.at, at: state.vs }) },
            "swap",
          )
        : null,
      state.vs
        ? TC.el(
            "span",
            { class: "note" },
            TC.run.pointAt(state.vs) === point
              ? "kept; now choose another point"
              : `dashed: ${TC.run.words(state.vs)}`,
          )
        : null,
      geometry.body
        ? TC.el(
            "label",
            {},
            TC.el("span", {}, "deformation: ", TC.el("output", { id: "deform-text" })),
            TC.el("input", {
              type: "range",
              min: 0,
              max: 3,
              step: 0.05,
              value: state.deform,
              "aria-label": "deformation",
              oninput: (event) => {
                state.deform = Number(event.target.value);
                TC.writeState();
                TC.point.drawBody(point);
              },
            }),
          )
        : null,
    );
    const left = (TC.point.left = TC.panel());
    const right = TC.panel();
    const compared =
      state.vs && TC.run.pointAt(state.vs) !== point ? TC.run.pointAt(state.vs) : null;
    TC.fill(host, heading, buttons, TC.el("div", { class: "columns wide" }, left, right));
    const frame = line && TC.point.frame(line, TC.width(left));
    if (frame && frame.shape) TC.point.bodyPanel(left, point, line, frame);
    if (
      line &&
      (proof !== "failed" || Number.isFinite(TC.row(line.u_T, TC.point.indexInGeometry(point))[0]))
    ) {
      const cases = [point, compared]
        .filter((shownPoint) => shownPoint !== null && TC.point.line(shownPoint, level))
        .map((shownPoint) => TC.point.contact(TC.point.line(shownPoint, level), shownPoint));
      const equilibrium = TC.point.equilibrium(line, point);
      if (equilibrium !== null) cases[0] = { ...cases[0], ...TC.point.state(line, equilibrium) };
      TC.point.profiles(
        left,
        line,
        cases,
        frame,
        geometry.lines[String(level)] !== line
          ? `level ${run.nlevels - 1} (the page holds no contact line of level ${level})`
          : "",
      );
      TC.point.law(right, line, cases, point, compared);
    } else if (!line && proof !== "failed")
      left.append(TC.note("The page was made without contact lines; the file has them."));
    if (line && line.every) TC.point.equilibria(right, line, point);
    TC.point.energies(right, point, level);
    TC.point.table(right, point, compared, level);
  },
  // Slip, friction and state at every contact node of a point, with the line that they are on.
  contact(line, point) {
    const index = TC.point.indexInGeometry(point);
    const nodeCount = line.x.length;
    return {
      line,
      u: TC.row(line.u_T, index),
      held: line.held_u_T ? TC.row(line.held_u_T, index) : null,
      xi: TC.row(line.xi, index),
      N: line.N && TC.row(line.N, index),
      state: line.state.subarray(index * nodeCount, (index + 1) * nodeCount),
    };
  },
  // Index of the chosen equilibrium among those of the line, where all are stored; null for the
  // solution.
  equilibrium(line, point) {
    if (!line.every) return null;
    const index = TC.point.indexInGeometry(point);
    const first = line.every.first[index];
    const chosen = Number(TC.state.eq) || 0;
    return chosen < line.every.first[index + 1] - first ? first + chosen : null;
  },
  state(line, index) {
    const nodeCount = line.x.length;
    const equilibria = line.every;
    return {
      u: TC.row(equilibria.u_T, index),
      xi: TC.row(equilibria.xi, index),
      N: null,
      state: equilibria.state.subarray(index * nodeCount, (index + 1) * nodeCount),
    };
  },
  equilibria(host, line, point) {
    const index = TC.point.indexInGeometry(point);
    const equilibria = line.every;
    const first = equilibria.first[index];
    const count = equilibria.first[index + 1] - first;
    const completeness = TC.run.flag("complete", point, TC.state.level);
    const units = TC.data.run.numbers.energy.units;
    const chosen = TC.point.equilibrium(line, point);
    let title = `at least ${count} equilibria`;
    if (completeness === 1) title = `${count} of ${count} equilibria, proved`;
    if (completeness === 2) {
      title = `${count} equilibria of the law's piecewise-linear approximation`;
    }
    const lowest = equilibria.energy[first];
    const energyText = (order) =>
      order
        ? `+ ${TC.quantity(equilibria.energy[first + order] - lowest, units, 4)}`
        : TC.quantity(lowest, units, 6);
    host.append(
      TC.h3(title),
      TC.note("by energy; a click shows the state along the contact line and on the law"),
      TC.el(
        "div",
        { class: "minima" },
        [...Array(Math.min(count, 100)).keys()].map((order) =>
          TC.el(
            "button",
            {
              "aria-label": `equilibrium ${order}`,
              "aria-pressed": first + order === chosen ? "true" : "false",
              onclick: () => TC.set({ eq: order }),
            },
            `${energyText(order)}, ${equilibria.stable[first + order] ? "stable" : "unstable"}`,
          ),
        ),
      ),
    );
  },
  // u_T at a constrained end: as stored, or 0 where every clamped edge is at rest, else NaN.
  heldSlip: (solution, part, end) =>
    !part.held[end]
      ? NaN
      : solution.held && part.ends[end] >= 0
        ? solution.held[part.ends[end]]
        : solution.line.rest
          ? 0
          : NaN,
  // The laws of a point: one, or one of every edge.
  lawsOf: (point) =>
    TC.data.laws
      ? [TC.data.laws.index[point]].flat().map((index) => TC.data.laws.laws[index])
      : [null],
  strength: (line, point) =>
    line.of_law ? TC.row(line.strengths, line.strength_of[TC.point.indexInGeometry(point)]) : null,
  // Place and scale of the body in pixels. `along`: the contact line runs along x, so that body
  // and profiles share an axis.
  frame(line, width) {
    const geometry = TC.point.currentGeometry;
    const xs = [];
    const ys = [];
    for (const edge of geometry.outline || [])
      for (const [x, y] of edge.line) {
        xs.push(x);
        ys.push(y);
      }
    if (geometry.body) {
      xs.push(...TC.range(geometry.body.x));
      ys.push(...TC.range(geometry.body.y));
    }
    const shape = xs.length > 0;
    const [yLow, yHigh] = TC.range(line.y);
    const xRange = shape ? TC.range(xs) : TC.range(line.x);
    const yRange = shape ? TC.range(ys) : [yLow, yHigh];
    const isAlongX = yHigh - yLow <= 1e-9 * (xRange[1] - xRange[0]);
    const margin = { left: 66, right: 100 };
    const drawnWidth = width - margin.left - margin.right;
    const unitsPerPixel = Math.max(
      (xRange[1] - xRange[0]) / drawnWidth,
      (yRange[1] - yRange[0]) / 340,
    );
    const scale = TC.scale(xRange, line.u_T_units);
    const usedWidth = (xRange[1] - xRange[0]) / unitsPerPixel;
    return {
      shape,
      width,
      margin,
      bx: xRange,
      by: yRange,
      per: unitsPerPixel,
      along: isAlongX,
      scale,
      used: usedWidth,
      top: 34,
      high: (yRange[1] - yRange[0]) / unitsPerPixel,
    };
  },
  bodyPanel(host, point, line, frame) {
    const extra = 26;
    const width = frame.width;
    const height = Math.ceil(frame.high + 2 * frame.top + extra);
    const geometry = TC.point.currentGeometry;
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
      geometry.body && geometry.body.theta
        ? `Temperature θ [${TC.unit(geometry.body.theta_units) || "1"}] and deformation`
        : geometry.body
          ? "Deformation"
          : "The body",
    );
    host.append(
      title,
      TC.el("div", { class: "stack", style: `height:${height}px` }, canvas, svg),
      TC.point.roleKey(),
    );
    TC.point.panel = { canvas, svg, frame, line, ratio, height };
    TC.point.drawBody(point);
  },
  roleKey() {
    const usedRoles = [
      ...new Set((TC.point.currentGeometry.outline || []).map((edge) => edge.role)),
    ];
    if (!usedRoles.length) return TC.el("span");
    const entries = Object.keys(TC.ROLES)
      .filter((role) => usedRoles.includes(role))
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
      ...entries,
      (TC.point.currentGeometry.sources || []).length ? TC.entry(28, 12, [heater], "heated") : "",
    );
  },
  toPx(frame, x, y) {
    return [
      frame.margin.left + (x - frame.bx[0]) / frame.per,
      frame.top + frame.high - (y - frame.by[0]) / frame.per,
    ];
  },
  drawBody(point) {
    const { canvas, svg, frame, line, ratio } = TC.point.panel;
    const body = TC.point.currentGeometry.body;
    const context = canvas.getContext("2d");
    const factor =
      body && TC.run.flag("status", point, body.level) === 1 ? body.factor * TC.state.deform : 0;
    const deformationText = document.getElementById("deform-text");
    if (deformationText) deformationText.textContent = `× ${TC.number(factor, 2)}`;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    const shapes = [];
    if (body) TC.point.fillBody(context, point, factor, frame, shapes);
    else TC.point.fillOutline(shapes, frame);
    TC.point.drawNames(shapes, frame, body ? TC.point.movedPixels(point, factor) : null);
    svg.replaceChildren(...shapes);
  },
  fillBody(context, point, factor, frame, shapes) {
    const body = TC.point.currentGeometry.body;
    const nodeCount = body.x.length;
    const displacementX = TC.field(body.u_x, TC.point.indexInGeometry(point));
    const displacementY = TC.field(body.u_y, TC.point.indexInGeometry(point));
    const xPixels = new Float64Array(nodeCount);
    const yPixels = new Float64Array(nodeCount);
    for (let node = 0; node < nodeCount; node++)
      [xPixels[node], yPixels[node]] = TC.point.toPx(
        frame,
        body.x[node] + factor * displacementX[node],
        body.y[node] + factor * displacementY[node],
      );
    const solved = TC.run.flag("status", point, body.level) === 1; // a failed point has no fields
    if (!solved)
      shapes.push(
        TC.svgNode(
          "text",
          { x: frame.margin.left, y: 16 },
          "no solution, so neither temperature nor deformation",
        ),
      );
    const theta =
      body.theta && solved ? TC.field(body.theta, TC.point.indexInGeometry(point)) : null;
    const [low, high] = theta ? TC.range(theta) : [0, 0];
    const isUniform = !theta || high - low <= 2e-3 * Math.max(Math.abs(low), Math.abs(high));
    const style = getComputedStyle(document.documentElement);
    const levels = isUniform ? [] : TC.ticks(low, high, 11);
    const colour = (fraction) => TC.css(TC.colour(fraction, TC.HEAT));
    const triangles = body.triangle;
    const cornersOf = (first, valueOf) =>
      [0, 1, 2].map((corner) => {
        const node = triangles[first + corner];
        return [xPixels[node], yPixels[node], valueOf(node)];
      });
    if (isUniform) {
      const polygons = [];
      for (let first = 0; first < triangles.length; first += 3)
        polygons.push(cornersOf(first, () => 0));
      TC.point.fillPolygons(
        context,
        polygons,
        theta ? colour(0.3) : style.getPropertyValue("--body"),
      );
    } else {
      const step = levels[1] - levels[0];
      const first = Math.floor(low / step) * step;
      const count = Math.max(1, Math.ceil((high - first) / step - 1e-9));
      const bands = [...Array(count)].map(() => []);
      for (let triangle = 0; triangle < triangles.length; triangle += 3) {
        const corners = cornersOf(triangle, (node) => (theta[node] - first) / step);
        const values = corners.map((corner) => corner[2]);
        const firstBand = Math.max(0, Math.floor(Math.min(...values)));
        const lastBand = Math.min(count - 1, Math.floor(Math.max(...values)));
        for (let band = firstBand; band <= lastBand; band++) {
          const polygon =
            firstBand === lastBand
              ? corners
              : TC.point.clipped(TC.point.clipped(corners, band, 1), band + 1, -1);
          if (polygon.length > 2) bands[band].push(polygon);
        }
      }
      bands.forEach((polygons, band) =>
        TC.point.fillPolygons(context, polygons, colour((band + 0.5) / count)),
      );
      TC.point.drawHeatBar(shapes, frame, first, step, count, colour);
    }
    if (theta && isUniform)
      shapes.push(
        TC.svgNode(
          "text",
          { x: frame.margin.left, y: 16 },
          `θ = ${TC.number(0.5 * (low + high), 4)} ${TC.unit(body.theta_units)} everywhere`,
        ),
      );
    for (const edge of TC.point.currentGeometry.outline || [])
      shapes.push(
        TC.point.polyline(
          edge.line.map(([x, y]) => TC.point.toPx(frame, x, y)),
          { fill: "none", stroke: "var(--soft)", "stroke-width": 1, "stroke-dasharray": "4 3" },
        ),
      );
    const edges = body.boundary;
    const byRole = {};
    const pixelText = (node) => `${xPixels[node].toFixed(1)},${yPixels[node].toFixed(1)}`;
    const outline = TC.point.currentGeometry.outline;
    for (let side = 0; side < edges.length / 2; side++) {
      const role = outline && body.edge[side] >= 0 ? outline[body.edge[side]].role : "free";
      byRole[role] = byRole[role] || [];
      byRole[role].push(`M${pixelText(edges[2 * side])}L${pixelText(edges[2 * side + 1])}`);
    }
    for (const role of Object.keys(TC.ROLES).reverse())
      if (byRole[role]) {
        const { words, ...look } = TC.ROLES[role];
        shapes.push(
          TC.svgNode("path", {
            d: byRole[role].join(""),
            fill: "none",
            ...look,
            "stroke-dasharray": null,
          }),
        );
      }
    TC.point.drawHeated(shapes, frame);
  },
  // Fills polygons in one colour; a thin line of it closes the gaps between neighbours.
  fillPolygons(context, polygons, colour) {
    context.fillStyle = colour;
    context.strokeStyle = colour;
    context.lineWidth = 0.6;
    context.beginPath();
    for (const polygon of polygons) {
      polygon.forEach(([x, y], corner) => {
        if (corner) context.lineTo(x, y);
        else context.moveTo(x, y);
      });
      context.closePath();
    }
    context.fill();
    context.stroke();
  },
  // The part of a polygon [x, y, value] with sign·value ≥ sign·bound.
  clipped(polygon, bound, sign) {
    const clipped = [];
    for (let corner = 0; corner < polygon.length; corner++) {
      const start = polygon[corner];
      const end = polygon[(corner + 1) % polygon.length];
      const startExcess = sign * (start[2] - bound);
      const endExcess = sign * (end[2] - bound);
      if (startExcess >= 0) clipped.push(start);
      if (startExcess * endExcess < 0) {
        const fraction = startExcess / (startExcess - endExcess);
        clipped.push([
          start[0] + fraction * (end[0] - start[0]),
          start[1] + fraction * (end[1] - start[1]),
          bound,
        ]);
      }
    }
    return clipped;
  },
  drawHeatBar(shapes, frame, first, step, count, colour) {
    const x = Math.min(frame.width - 44, frame.margin.left + frame.used + 54);
    const barHeight = Math.min(frame.high, 220);
    const top = frame.top + (frame.high - barHeight) / 2;
    const bandHeight = barHeight / count;
    const text = TC.tickText([...Array(count + 1)].map((_, band) => first + band * step));
    const labelStride = Math.max(1, Math.ceil(14 / bandHeight));
    for (let band = 0; band < count; band++)
      shapes.push(
        TC.svgNode("rect", {
          x,
          y: top + barHeight - (band + 1) * bandHeight,
          width: 11,
          height: bandHeight + 0.5,
          fill: colour((band + 0.5) / count),
        }),
      );
    for (let band = 0; band <= count; band += labelStride)
      shapes.push(
        TC.svgNode(
          "text",
          { x: x + 15, y: top + barHeight - band * bandHeight + 4 },
          text(first + band * step),
        ),
      );
  },
  polyline: (vertices, attrs) =>
    TC.svgNode("path", {
      d: vertices
        .map(([x, y], index) => `${index ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`)
        .join(""),
      ...attrs,
    }),
  fillOutline(shapes, frame) {
    const edgeLines = TC.point.currentGeometry.outline.map((edge) =>
      edge.line.map(([x, y]) => TC.point.toPx(frame, x, y)),
    );
    let path = "";
    let lastVertex = null;
    for (const vertices of edgeLines)
      vertices.forEach(([x, y], index) => {
        // an edge that starts where the last one ended goes on with its line
        const isJoined =
          lastVertex !== null && Math.hypot(x - lastVertex[0], y - lastVertex[1]) < 1e-6;
        path += `${index || isJoined ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`;
        lastVertex = [x, y];
      });
    shapes.push(
      TC.svgNode("path", {
        d: path,
        fill: "var(--body)",
        "fill-rule": "evenodd",
        stroke: "none",
      }),
    );
    TC.point.currentGeometry.outline.forEach((edge, index) => {
      const { words, ...look } = TC.ROLES[edge.role];
      shapes.push(TC.point.polyline(edgeLines[index], { fill: "none", ...look }));
    });
    TC.point.drawHeated(shapes, frame);
  },
  drawHeated(shapes, frame) {
    for (const loop of TC.point.currentGeometry.sources || [])
      shapes.push(
        TC.point.polyline(
          [...loop, loop[0]].map(([x, y]) => TC.point.toPx(frame, x, y)),
          { fill: "none", stroke: "var(--bad)", "stroke-width": 1.5, "stroke-dasharray": "4 3" },
        ),
      );
  },
  // Where the middle of a named edge goes with the deformation, in pixels.
  movedPixels(point, factor) {
    const body = TC.point.currentGeometry.body;
    const displacementX = TC.field(body.u_x, TC.point.indexInGeometry(point));
    const displacementY = TC.field(body.u_y, TC.point.indexInGeometry(point));
    const frame = TC.point.panel.frame;
    return (x, y) => {
      let nearest = 0;
      let smallestDistance = Infinity;
      for (const node of body.boundary) {
        const distance = (body.x[node] - x) ** 2 + (body.y[node] - y) ** 2;
        if (distance < smallestDistance) {
          smallestDistance = distance;
          nearest = node;
        }
      }
      return TC.point.toPx(
        frame,
        x + factor * displacementX[nearest],
        y + factor * displacementY[nearest],
      );
    };
  },
  // Names of edges, each once, outside its longest piece.
  drawNames(shapes, frame, moved) {
    const longest = new Map();
    const size = (edge) => {
      let length = 0;
      for (let index = 1; index < edge.line.length; index++) {
        const [x, y] = edge.line[index - 1];
        length += Math.hypot(edge.line[index][0] - x, edge.line[index][1] - y);
      }
      return length;
    };
    for (const edge of TC.point.currentGeometry.outline || []) {
      const longestPiece = longest.get(edge.name);
      if (!longestPiece || size(edge) > size(longestPiece)) longest.set(edge.name, edge);
    }
    for (const edge of longest.values()) {
      const middleVertex = Math.floor((edge.line.length - 1) / 2);
      const start = edge.line[middleVertex];
      const end = edge.line[middleVertex + 1];
      const [ax, ay] = TC.point.toPx(frame, ...start);
      const [bx, by] = TC.point.toPx(frame, ...end);
      const length = Math.hypot(bx - ax, by - ay) || 1;
      const normalX = -(by - ay) / length;
      // outward for a counter-clockwise outline, as y points downwards on the screen
      const normalY = (bx - ax) / length;
      if (edge.loop) {
        // a hole's name stands inside the hole
        const loopVertices = TC.point.currentGeometry.outline
          .filter((other) => other.loop === edge.loop)
          .flatMap((other) => other.line)
          .map(([x, y]) => TC.point.toPx(frame, x, y));
        const [left, right] = TC.range(loopVertices.map((vertex) => vertex[0]));
        const [top, bottom] = TC.range(loopVertices.map((vertex) => vertex[1]));
        if (right - left > 8 * edge.name.length)
          shapes.push(
            TC.svgNode(
              "text",
              {
                x: (left + right) / 2,
                y: (top + bottom) / 2 + 4,
                class: "soft",
                "text-anchor": "middle",
              },
              edge.name,
            ),
          );
        continue;
      }
      const middle = [0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])];
      const undeformed = [(ax + bx) / 2, (ay + by) / 2];
      const [movedX, movedY] = moved ? moved(...middle) : undeformed;
      const outwardMove = Math.max(
        0,
        (movedX - undeformed[0]) * normalX + (movedY - undeformed[1]) * normalY,
      );
      const labelX = undeformed[0] + (13 + outwardMove) * normalX;
      const labelY = undeformed[1] + (13 + outwardMove) * normalY;
      shapes.push(
        TC.svgNode(
          "text",
          {
            x: labelX,
            y: labelY + 4,
            class: "halo soft",
            "text-anchor": normalX > 0.5 ? "start" : normalX < -0.5 ? "end" : "middle",
          },
          edge.name,
        ),
      );
    }
  },
  // The profiles along the contact line: slip and section force from node to node, friction on
  // segments.
  ALONG: [
    ["u", "slip", "slip u_T", "u_T_units", "var(--c1)"],
    ["xi", "friction", "friction ξ = −S_T", "xi_units", "var(--c2)"],
    ["N", "section force", "section force N", "N_units", "var(--c3)"],
  ],
  // Place of a node on the axis of the profiles: its x, or its arc length.
  position: (frame, line, node) => (frame.along ? line.x : line.arclength)[node] / frame.scale.by,
  // Place of an arc length of a part of the contact line on the axis of the profiles.
  placeAt(frame, line, part, arclength) {
    const isLeftward = part.b - part.a > 1 && line.x[part.b - 1] < line.x[part.a];
    const direction = frame.along && isLeftward ? -1 : 1;
    const distance = arclength - line.arclength[part.a];
    return TC.point.position(frame, line, part.a) + (direction * distance) / frame.scale.by;
  },
  profiles(host, line, cases, frame, note) {
    const plots = TC.point.profilePlots(line, cases, frame);
    cases.forEach((solution, row) => {
      const dash = row ? { "stroke-dasharray": "6 4", opacity: 0.85 } : {};
      for (const part of solution.line.parts) {
        TC.point.drawProfiles(plots, solution, part, frame, dash);
        if (row === 0) TC.point.drawStates(plots[0].plot, solution, part, frame);
        if (row === 0) TC.point.drawHeldEnds(plots, solution, part, frame);
      }
    });
    const nodePosition = (node) => TC.point.position(frame, line, node);
    TC.point.showUnderPointer(plots, line, cases[0], nodePosition);
    const profileNames =
      plots.length > 2 ? "Slip, friction and section force" : "Slip and friction";
    host.append(
      TC.h3(`${profileNames} along ${line.edges.join(", ") || "the contact line"}`),
      ...plots.map(({ plot }) => plot.svg),
      TC.point.stateKey(line, cases[0]),
      note ? TC.note(note) : "",
    );
  },
  profilePlots(line, cases, frame) {
    const width = frame.width;
    const divisor = frame.scale.by;
    const isBelowBody = frame.along && frame.shape;
    const margin = {
      left: frame.margin.left,
      right: isBelowBody ? width - frame.margin.left - frame.used : 20,
    };
    const bodyEnds = isBelowBody ? frame.bx.map((value) => value / divisor) : [];
    const lineEnds = cases.flatMap(({ line: ownLine }) =>
      ownLine.parts.flatMap((part) => [
        TC.point.placeAt(frame, ownLine, part, part.cells[0]),
        TC.point.placeAt(frame, ownLine, part, part.cells[part.cells.length - 1]),
      ]),
    );
    const xRange = TC.range([...bodyEnds, ...lineEnds]);
    const rows = TC.point.ALONG.filter(([key]) => cases[0][key]);
    return rows.map(([key, name, title, units, stroke], row) => {
      const isLastRow = row === rows.length - 1;
      const values = cases.flatMap((solution) =>
        TC.range(
          [...(solution[key] || []), ...(key === "u" && solution.held ? solution.held : [])],
          [],
        ),
      );
      const scale = TC.scale(values, line[units]);
      const yRange = TC.pad(TC.range([0, ...values.map((value) => value / scale.by)]));
      const plotMargin = { ...margin, top: row ? 8 : 20, bottom: isLastRow ? 46 : 8 };
      return {
        key,
        word: name,
        scale,
        stroke,
        plot: new TC.Plot({
          width,
          height: 150 + plotMargin.top + plotMargin.bottom,
          x: xRange,
          y: yRange,
          xlabel: isLastRow
            ? TC.withUnit(frame.along ? "x" : "arc length along the contact line", frame.scale)
            : "",
          ylabel: TC.withUnit(title, scale),
          margin: plotMargin,
          xnone: !isLastRow,
          label: `${name} along the contact line`,
        }),
      };
    });
  },
  nodesOfPart: (part) => [...Array(part.b - part.a).keys()].map((index) => part.a + index),
  drawProfiles(plots, solution, part, frame, dash) {
    const line = solution.line;
    const nodes = TC.point.nodesOfPart(part);
    const nodePositions = nodes.map((node) => TC.point.position(frame, line, node));
    const edges = Array.from(part.cells, (s) => TC.point.placeAt(frame, line, part, s));
    const start = edges[0];
    const end = edges[edges.length - 1];
    if (part.closed) {
      edges[0] = nodePositions[0];
      edges.push(edges[0] + end - start);
    }
    for (const { key, scale, stroke, plot } of plots) {
      if (!solution[key]) continue;
      const xs = nodePositions.slice();
      const values = nodes.map((node) => solution[key][node] / scale.by);
      const look = { stroke, "stroke-width": 2, ...dash };
      if (part.closed) {
        xs.push(end);
        values.push(values[0]);
      }
      if (key === "xi") {
        plot.steps(edges, values, look);
        continue;
      }
      if (key === "u") {
        // slip goes on to an end of the line whose slip is known
        const slips = [0, 1].map((side) => TC.point.heldSlip(solution, part, side));
        if (Number.isFinite(slips[0])) {
          xs.unshift(start);
          values.unshift(slips[0] / scale.by);
        }
        if (Number.isFinite(slips[1])) {
          xs.push(end);
          values.push(slips[1] / scale.by);
        }
      }
      plot.line(xs, values, look);
    }
  },
  // The states of the nodes as a bar above the first profile.
  drawStates(plot, solution, part, frame) {
    const line = solution.line;
    for (const node of TC.point.nodesOfPart(part)) {
      const [left, right] = [0, 1].map((end) =>
        plot.px(TC.point.placeAt(frame, line, part, part.cells[node - part.a + end])),
      );
      plot.over.append(
        TC.svgNode("rect", {
          x: Math.min(left, right),
          y: 4,
          width: Math.abs(right - left) + 0.4,
          height: 9,
          fill: TC.stateOf(line, solution.state[node]).colour,
        }),
      );
    }
  },
  drawHeldEnds(plots, solution, part, frame) {
    const arclengths = [part.cells[0], part.cells[part.cells.length - 1]];
    for (const { key, scale, plot } of plots)
      for (const end of [0, 1]) {
        if (!part.held[end]) continue;
        const slip = TC.point.heldSlip(solution, part, end);
        const x = plot.px(TC.point.placeAt(frame, solution.line, part, arclengths[end]));
        const y = plot.py(key === "u" && Number.isFinite(slip) ? slip / scale.by : 0);
        const hatches = [-8, -2, 4].map((shift) => `M${x},${y + shift}l-5,5`).join("");
        plot.over.append(
          TC.svgNode(
            "path",
            {
              d: `M${x},${y - 8}V${y + 8}${hatches}`,
              stroke: "var(--ink)",
              "stroke-width": 1.5,
              fill: "none",
            },
            TC.svgNode("title", {}, "constrained end"),
          ),
        );
      }
  },
  // The legend of the states, with the share of the contact line in each.
  stateKey(line, solution) {
    const shares = TC.STATES.map(() => 0);
    const total = line.c.reduce((sum, length) => sum + length, 0);
    line.c.forEach((length, node) => {
      shares[solution.state[node]] += length / total;
    });
    const entries = shares.map((share, code) => {
      const { colour, name } = TC.stateOf(line, code);
      return share > 0 ? TC.swatch(colour, `${name} (${Math.round(100 * share)} %)`) : "";
    });
    const hasHeldEnd = line.parts.some((part) => part.held[0] || part.held[1]);
    return TC.legend(...entries, hasHeldEnd ? "hatched bar: constrained end" : "");
  },
  // The values at the node under the pointer.
  showUnderPointer(plots, line, solution, positionOf) {
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
    const firstPlot = plots[0].plot;
    const text = firstPlot.text(firstPlot.right, 30, "", {
      "text-anchor": "end",
      visibility: "hidden",
    });
    const setVisibility = (visibility) =>
      [...marks, text].forEach((mark) => mark.setAttribute("visibility", visibility));
    for (const { plot } of plots) {
      plot.svg.addEventListener("pointermove", (event) => {
        const position = plot.ix(event.clientX - plot.svg.getBoundingClientRect().left);
        let nearest = 0;
        for (let node = 1; node < solution.u.length; node++)
          if (Math.abs(positionOf(node) - position) < Math.abs(positionOf(nearest) - position))
            nearest = node;
        for (const mark of marks)
          for (const side of ["x1", "x2"]) mark.setAttribute(side, plot.px(positionOf(nearest)));
        const values = plots.map(({ key, word, scale }) => {
          const value = TC.number(solution[key][nearest] / scale.by);
          return `${word} ${value} ${scale.unit}`;
        });
        text.textContent = [...values, TC.stateOf(line, solution.state[nearest]).name].join(", ");
        setVisibility("visible");
      });
      plot.svg.addEventListener("pointerleave", () => setVisibility("hidden"));
    }
  },
  // The law strength · b(s / stretch) with the place of every node on it.
  lawPlot(width, title, data, cases, line, strength = 1, stretch = 1) {
    const law = new TC.Law(data.pieces, strength, stretch);
    const slips = cases.flatMap((solution) => TC.range(solution.u));
    const widest = Math.max(...slips.map(Math.abs), 0);
    const slipsAndZero = [...slips, 0];
    const lawReach = data.reach * stretch;
    const reach =
      lawReach > 0 ? Math.min(lawReach, Math.max(3 * widest, 0.2 * lawReach)) : widest || 1;
    const hasBothSigns = Math.min(...slipsAndZero) < -0.02 * widest;
    const low = Math.min(hasBothSigns ? -0.6 * reach : -0.12 * reach, ...slipsAndZero);
    const high = Math.max(
      hasBothSigns && Math.max(...slipsAndZero) < 0.02 * widest ? 0.12 * reach : reach,
      ...slipsAndZero,
    );
    const [xLow, xHigh] = TC.pad([low, high], 0.02);
    const kinksInRange = [...law.kinks.keys()].filter(
      (kink) => law.kinks[kink] > xLow && law.kinks[kink] < xHigh,
    );
    const segmentEnds = [xLow, ...kinksInRange.map((kink) => law.kinks[kink]), xHigh];
    const curves = segmentEnds.slice(1).map((end, index) => {
      const start = segmentEnds[index];
      const kink = law.piece(0.5 * (start + end), 1);
      const steps = law.a[kink] === 0 ? 1 : 60;
      const slips = [...Array(steps + 1).keys()].map(
        (step) => start + ((end - start) * step) / steps,
      );
      return [slips, slips.map((value) => law.value(value, kink))];
    });
    const tractions = [
      0,
      ...curves.flatMap(([, traction]) => TC.range(traction)),
      ...cases.flatMap((solution) => TC.range(solution.xi)),
    ];
    const slipScale = TC.scale([low, high], line.u_T_units);
    const tractionScale = TC.scale(tractions, line.xi_units);
    const scaled = (slips, traction) => ({
      x: Array.from(slips, (value) => value / slipScale.by),
      y: Array.from(traction, (value) => value / tractionScale.by),
    });
    const looks = TC.data.law_looks;
    const items = curves.map(([slips, traction]) => ({
      kind: "line",
      ...scaled(slips, traction),
      ...looks.curve,
    }));
    for (const kink of kinksInRange.filter((index) => law.kind[index] !== 0))
      items.push({
        kind: "line",
        ...scaled([law.kinks[kink], law.kinks[kink]], [law.left[kink], law.right[kink]]),
        ...looks[String(law.kind[kink])],
      });
    cases.forEach((solution, kink) =>
      items.push({
        kind: "marks",
        ...scaled(solution.u, solution.xi),
        shape: "circle",
        r: 3.2,
        alpha: kink ? 0 : 0.55,
        fill: (index) => TC.stateOf(line, solution.state[index]).colour,
      }),
    );
    const limits = [
      [xLow / slipScale.by, xHigh / slipScale.by],
      TC.pad(TC.range(tractions.map((value) => value / tractionScale.by)), 0.08),
    ];
    return TC.part.panel(
      {
        title,
        labels: [TC.withUnit("slip u_T", slipScale), TC.withUnit("ξ", tractionScale)],
        log: [false, false],
        limits,
        items,
        high: 270,
      },
      width,
    );
  },
  law(host, line, cases, point, compared) {
    const laws = TC.point.lawsOf(point);
    const strength = TC.point.strength(line, point);
    const units = line.xi_units === "1" ? "1" : "Pa m-1";
    if (!laws[0]) {
      host.append(
        TC.h3("Friction law"),
        TC.note(
          "The page has no laws: " +
            "the text of the study cannot be read here, or it has too many points.",
        ),
      );
      return;
    }
    laws.forEach((law, index) => {
      const difference =
        compared !== null && TC.point.lawsOf(compared)[index] !== law
          ? " (the compared point has another law; its places are drawn all the same)"
          : "";
      const edge = strength && TC.data.laws.edges[index] ? ` of ${TC.data.laws.edges[index]}` : "";
      const scaled =
        strength && [...strength].some((factor) => factor > 0 && Math.abs(factor - 1) > 1e-4);
      const omega =
        law.omega === Infinity || law.omega === null ? "∞" : TC.quantity(law.omega, units);
      const solutions = strength
        ? cases.map((solution) => TC.point.nodesOfEdge(solution, strength, index))
        : cases;
      host.append(
        TC.point.lawPlot(
          TC.width(host),
          `Friction law${edge} (${law.name}) and where every node stands on it`,
          law,
          solutions,
          line,
        ),
        TC.legend(
          `maximum softening slope ω = ${omega}` +
            (scaled ? "; ξ divided by the strength at its node" : "") +
            difference,
        ),
      );
    });
  },
  // The nodes of one edge's law, without gaps in the bond, ξ as the law has it.
  nodesOfEdge(solution, strength, law) {
    const nodes = [...solution.u.keys()].filter(
      (node) => solution.line.of_law[node] === law && strength[node] > 0,
    );
    const pick = (values) => nodes.map((node) => values[node]);
    return {
      u: pick(solution.u),
      xi: nodes.map((node) => solution.xi[node] / strength[node]),
      state: pick(solution.state),
    };
  },
  energies(host, point, level) {
    const run = TC.data.run;
    const energies = TC.run.energies(point, level);
    const starts = energies
      .map((energy, index) => ({
        v: energy,
        name: run.starts[index],
        used: TC.run.flag("start_used", point, level) === index,
      }))
      .filter((start) => Number.isFinite(start.v));
    if (!starts.length) return;
    const lowest = Math.min(...starts.map((start) => start.v));
    const largest = Math.max(...starts.map((start) => Math.abs(start.v))) || 1;
    const units = run.numbers.energy ? run.numbers.energy.units : "1";
    const gapText = (gap) => (gap <= 1e-9 * largest ? "least" : `+ ${TC.quantity(gap, units, 3)}`);
    const rows = starts.map((start) => [
      start.name,
      TC.quantity(start.v, units, 5),
      gapText(start.v - lowest),
      start.used ? "stored" : "",
    ]);
    host.append(
      TC.h3("Energy of the solution that each start leads to"),
      TC.wideTable(
        ["start", "energy", "", ""],
        rows,
        (index) => (index === 0 || index === 3) && "text",
      ),
      TC.note(
        TC.run.hasSeveral(point, level)
          ? "Different energies: more than one solution was found."
          : "All starts lead to the same energy.",
      ),
    );
  },
  table(host, point, compared, level) {
    const run = TC.data.run;
    const valueText = (name, shownPoint) =>
      TC.quantity(TC.run.value(name, shownPoint, level), run.numbers[name].units, 5);
    const quantities = Object.keys(run.numbers).filter(
      (quantity) =>
        Number.isFinite(TC.run.value(quantity, point, level)) ||
        TC.run.value(quantity, point, level) === Infinity,
    );
    const rows = quantities.map((quantity) =>
      TC.el(
        "tr",
        {},
        TC.el("th", { title: run.numbers[quantity].long_name }, TC.symbol(quantity)),
        TC.el("td", {}, valueText(quantity, point)),
        compared !== null ? TC.el("td", {}, valueText(quantity, compared)) : null,
      ),
    );
    const head =
      compared !== null
        ? TC.el(
            "tr",
            {},
            TC.el("th", {}, ""),
            TC.el("td", {}, TC.el("b", {}, "this point")),
            TC.el("td", {}, TC.el("b", {}, TC.run.words(TC.run.indicesOf(compared)))),
          )
        : null;
    host.append(
      TC.el(
        "details",
        { open: compared !== null || (run.asked || []).length > 0 },
        TC.el("summary", {}, "All numbers of this point"),
        TC.el("table", { class: "facts" }, TC.el("tbody", {}, head, rows)),
      ),
    );
  },
};
