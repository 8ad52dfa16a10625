// What pages of contact edges that may open show beside: gaps over the foundation, S_N along the
// contact line, the law of the opening. Openings stand in the data as a line of their own, with
// the opening in place of u_T and S_N in place of ξ.
TC.openings = {
  STATES: ["closed", "elastic bond", "softening bond", "open"],
  ALONG: [
    ["u", "opening", "opening s_N", "u_T_units", "var(--c1)"],
    ["xi", "normal stress", "S_N", "xi_units", "var(--c2)"],
  ],
  // Openings, normal stresses and states of a solution on its line.
  solution(line, u_T, xi, state, index) {
    const nodeCount = line.x.length;
    return {
      line,
      u: TC.row(u_T, index),
      held: null,
      xi: TC.row(xi, index),
      N: null,
      state: state.subarray(index * nodeCount, (index + 1) * nodeCount),
    };
  },
  profiles(host, cases, frame) {
    const { line } = cases[0];
    line.moves = line.moves || TC.openings.STATES;
    const usual = TC.point.ALONG;
    TC.point.ALONG = TC.openings.ALONG;
    const plots = TC.point.profilePlots(line, cases, frame);
    TC.point.ALONG = usual;
    const [gap] = plots;
    TC.openings.drawFoundation(gap.plot);
    cases.forEach((solution, row) => {
      const dash = row ? { "stroke-dasharray": "6 4", opacity: 0.85 } : {};
      for (const part of solution.line.parts) {
        if (row === 0) TC.openings.fillGap(gap, solution, part, frame);
        TC.point.drawProfiles(plots, solution, part, frame, dash);
        if (row === 0) TC.point.drawStates(gap.plot, solution, part, frame);
      }
    });
    const nodePosition = (node) => TC.point.position(frame, line, node);
    TC.point.showUnderPointer(plots, line, cases[0], nodePosition);
    host.append(
      TC.h3("Gap to the foundation, and normal stress, positive in tension"),
      ...plots.map(({ plot }) => plot.svg),
      TC.point.stateKey(line, cases[0]),
    );
  },
  drawFoundation(plot) {
    const top = plot.py(0);
    plot.back.append(
      TC.svgNode("rect", {
        x: plot.left,
        y: top,
        width: plot.right - plot.left,
        height: Math.max(0, plot.bottom - top),
        fill: "var(--body)",
      }),
    );
  },
  fillGap({ scale, plot }, solution, part, frame) {
    const { line, u } = solution;
    const nodes = TC.point.nodesOfPart(part);
    const place = (node) => plot.px(TC.point.position(frame, line, node));
    const above = nodes.map((node) => [place(node), plot.py(u[node] / scale.by)]);
    const ends = [nodes[nodes.length - 1], nodes[0]].map((node) => [place(node), plot.py(0)]);
    const look = { fill: "var(--c1)", "fill-opacity": 0.2, stroke: "none" };
    plot.inner.append(TC.point.polyline([...above, ...ends], look));
  },
  // The foundation below a deformed body, with hatches, and the gap between them.
  foundationShapes(point) {
    const { frame, line } = TC.point.panel;
    const { body, outline } = TC.point.currentGeometry;
    if (!line.openings || !body || !outline) return [];
    const isSolved = TC.run.flag("status", point, body.level) === 1;
    const factor = isSolved ? body.factor * TC.state.deform : 0;
    const index = TC.point.indexInGeometry(point);
    const u = [TC.field(body.u_x, index), TC.field(body.u_y, index)];
    const still = (node) => TC.point.toPx(frame, body.x[node], body.y[node]);
    const moved = (node) =>
      TC.point.toPx(
        frame,
        body.x[node] + factor * u[0][node],
        body.y[node] + factor * u[1][node],
      );
    const shapes = [];
    let hatches = "";
    let carry = 0;
    for (let side = 0; side < body.boundary.length / 2; side++) {
      const edge = body.edge[side] >= 0 ? outline[body.edge[side]].name : "";
      if (!line.openings.opens.includes(edge)) continue;
      const [start, end] = [body.boundary[2 * side], body.boundary[2 * side + 1]];
      const gap = [still(start), still(end), moved(end), moved(start)];
      const look = { fill: "var(--c1)", "fill-opacity": 0.2, stroke: "none" };
      shapes.push(TC.point.polyline(gap, look));
      const [[ax, ay], [bx, by]] = gap;
      const length = Math.hypot(bx - ax, by - ay) || 1;
      const [tx, ty] = [(bx - ax) / length, (by - ay) / length];
      // the body lies on the left of its sides, as seen with y upwards
      for (; carry <= length; carry += 8) {
        const [x, y] = [ax + carry * tx, ay + carry * ty];
        const [dx, dy] = [-5 * (ty + tx), 5 * (tx - ty)];
        hatches += `M${x.toFixed(1)},${y.toFixed(1)}l${dx.toFixed(1)},${dy.toFixed(1)}`;
      }
      carry -= length;
    }
    shapes.push(TC.svgNode("path", { d: hatches, stroke: "var(--soft)", fill: "none" }));
    return shapes;
  },
  // The friction law of a solution where it acts: ξ over the pressure of a node where the law is
  // a coefficient, no mark where the node is not pressed.
  pressed(solution, isCoefficient) {
    const { line, openings } = solution;
    const pressure = new Map();
    openings.line.arclength.forEach((s, node) => pressure.set(s, -openings.xi[node]));
    const pressures = Array.from(line.arclength, (s) => pressure.get(s) ?? 0);
    const xi = Array.from(solution.xi, (value, node) => {
      if (!(pressures[node] > 0)) return NaN;
      return isCoefficient ? value / pressures[node] : value;
    });
    return { ...solution, xi };
  },
  laws(host, line, cases, point) {
    const laws = TC.data.laws && TC.data.laws.openings;
    if (!laws) return;
    laws.index[point].forEach((number, order) => {
      const law = laws.laws[number];
      const edge = laws.edges[order];
      const solutions = cases.map((solution) => TC.openings.onEdge(solution, edge));
      host.append(TC.openings.lawPlot(TC.width(host), edge, law, line, solutions));
    });
  },
  // The nodes of one edge alone.
  onEdge(solution, edge) {
    const code = solution.line.edges.indexOf(edge);
    const isOnEdge = (_, node) => solution.line.edge[node] === code;
    return {
      u: Array.from(solution.u).filter(isOnEdge),
      xi: Array.from(solution.xi).filter(isOnEdge),
      state: Array.from(solution.state).filter(isOnEdge),
    };
  },
  lawPlot(width, edge, data, line, cases) {
    const law = new TC.Law(data.pieces);
    const [low, high] = TC.range(
      [0, ...cases.flatMap(({ u }) => TC.range(u)), data.closed ? 0 : -0.1 * data.reach],
      [0, 1],
    );
    const reach = Math.max(Math.min(data.reach, Math.max(3 * high, 0.2 * data.reach)), high);
    const kinks = [...law.kinks].filter((kink) => kink > low && kink < reach);
    const ends = [low, ...kinks, reach];
    const curves = ends.slice(1).map((end, index) => {
      const piece = law.piece(0.5 * (ends[index] + end), 1);
      const count = law.a[piece] === 0 ? 1 : 60;
      const s = [...Array(count + 1).keys()].map(
        (step) => ends[index] + ((end - ends[index]) * step) / count,
      );
      return [s, s.map((value) => law.value(value, piece))];
    });
    const tractions = cases.flatMap(({ xi }) => TC.range(xi, []));
    if (data.closed) curves.unshift([[0, 0], [Math.min(0, ...tractions), law.b(0, 1)]]);
    const all = [...tractions, ...curves.flatMap(([, b]) => b)];
    const [s_N, S_N] = [TC.scale([low, reach], line.u_T_units), TC.scale(all, line.xi_units)];
    const scaled = (x, y) => ({
      x: Array.from(x, (value) => value / s_N.by),
      y: Array.from(y, (value) => value / S_N.by),
    });
    const items = curves.map(([s, b]) => ({
      kind: "line",
      ...scaled(s, b),
      ...TC.data.law_looks.curve,
    }));
    cases.forEach((solution, row) =>
      items.push({
        kind: "marks",
        ...scaled(solution.u, solution.xi),
        shape: "circle",
        r: 3.2,
        alpha: row ? 0 : 0.55,
        fill: (node) => TC.stateOf(line, solution.state[node]).colour,
      }),
    );
    const title = `Law of the opening of ${edge} (${data.name}) and where every node stands on it`;
    return TC.part.panel(
      {
        title,
        labels: [TC.withUnit("opening s_N", s_N), TC.withUnit("S_N", S_N)],
        log: [false, false],
        limits: [null, null],
        items,
        high: 270,
      },
      width,
    );
  },
};
{
  const { contact, state, profiles, drawBody, law } = TC.point;
  const lineOfState = TC.part.line;
  TC.part.line = (part, width) => {
    const host = lineOfState(part, width);
    const own = part.line.openings;
    if (!own) return host;
    const solution = TC.openings.solution(own, own.u_T, own.xi, own.state, TC.state.step);
    const above = TC.el("div");
    const frame = { ...TC.point.frame(part.line, width), shape: false };
    TC.openings.profiles(above, [solution], frame);
    host.prepend(above);
    return host;
  };
  TC.point.contact = (line, point) => {
    const solution = contact(line, point);
    const own = line.openings;
    if (!own) return solution;
    const index = TC.point.indexInGeometry(point);
    return { ...solution, openings: TC.openings.solution(own, own.u_T, own.xi, own.state, index) };
  };
  TC.point.state = (line, index) => {
    const { openings, openings_u_T, openings_xi, openings_state } = {
      ...line.every,
      openings: line.openings,
    };
    const solution = state(line, index);
    if (!openings || !openings_u_T) return solution;
    const own = TC.openings.solution(openings, openings_u_T, openings_xi, openings_state, index);
    return { ...solution, openings: own };
  };
  TC.point.profiles = (host, line, cases, frame, note) => {
    const openings = cases.map((solution) => solution.openings).filter(Boolean);
    if (openings.length) TC.openings.profiles(host, openings, frame);
    profiles(host, line, cases, frame, note);
  };
  TC.point.drawBody = (point) => {
    drawBody(point);
    TC.point.panel.svg.prepend(...TC.openings.foundationShapes(point));
  };
  TC.point.law = (host, line, cases, point, compared) => {
    const openings = cases.map((solution) => solution.openings).filter(Boolean);
    if (openings.length) TC.openings.laws(host, openings[0].line, openings, point);
    const laws = TC.point.lawsOf(point).filter(Boolean);
    if (openings.length && laws.every((one) => one.vanishes)) return;
    const isPressed = laws.length > 0 && TC.data.laws.pressed && openings.length === cases.length;
    if (!isPressed) {
      law(host, line, cases, point, compared);
      return;
    }
    const isCoefficient = laws.every((one) => one.coefficient);
    const pressed = cases.map((solution) => TC.openings.pressed(solution, isCoefficient));
    law(host, isCoefficient ? { ...line, xi_units: "1" } : line, pressed, point, compared);
    host.append(
      TC.note(
        isCoefficient
          ? "ξ over the pressure of its node; nodes that are not pressed carry no friction"
          : "friction acts where its node is pressed; others have no mark",
      ),
    );
  };
}
