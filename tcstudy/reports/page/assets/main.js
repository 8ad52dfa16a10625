// Start: decode, restore the state from the address, draw, listen.
TC.draw = function () {
  const kind = TC.data.kind;
  if (!TC.data.run) TC.others.page(kind);
  else if (TC.state.mode === "live") TC.live.draw();
  else TC.run.draw();
  for (const button of document.querySelectorAll("#modes button")) button.setAttribute("aria-selected", String(button.value === TC.state.mode));
};
TC.theme = function (name) {
  document.documentElement.dataset.theme = name;
  TC.state.theme = name;
};
TC.start = async function () {
  TC.data = await TC.decode(document.getElementById("data").textContent);
  const d = TC.data, part = d[d.kind], given = TC.readState(), kinds = { run: "a parametric study", convergence: "convergence of a study", cost: "accuracy against cost", path: "equilibria along a parameter", history: "a load history", fit: "numbers from measurements" };
  document.getElementById("kind").textContent = `tcstudy: ${kinds[d.kind]}`;
  const verdict = document.getElementById("verdict");
  verdict.classList.toggle("bad", !part.verdict.ok);
  document.getElementById("how").textContent = part.verdict.how ? `${part.verdict.how[0].toUpperCase()}${part.verdict.how.slice(1)}.` : "";
  if (given.theme) TC.theme(given.theme);
  if (d.run) TC.run.setup();
  else for (const key in given) TC.state[key] = /^-?\d+$/.test(given[key]) ? Number(given[key]) : given[key];
  if (d.live) {
    const nav = document.getElementById("modes"), go = (mode) => () => { TC.run.host = null; TC.live.host = null; document.getElementById("main").replaceChildren(); TC.set({ mode }); };
    nav.hidden = false;
    nav.append(TC.el("button", { value: "", role: "tab", onclick: go("") }, "Stored results"), TC.el("button", { value: "live", role: "tab", onclick: go("live") }, "Explore live: solve here, in the browser"));
  }
  TC.draw();
  let width = window.innerWidth, timer = null;
  window.addEventListener("resize", () => { if (window.innerWidth !== width) { width = window.innerWidth; clearTimeout(timer); timer = setTimeout(TC.draw, 120); } });
  window.addEventListener("hashchange", () => { TC.run.host = null; TC.others.host = null; TC.live.host = null; Object.keys(TC.state).forEach((k) => delete TC.state[k]); if (d.run) TC.run.setup(); else Object.assign(TC.state, TC.readState()); document.getElementById("main").replaceChildren(); TC.draw(); });
  document.getElementById("theme").addEventListener("click", TC.toggle);
  document.getElementById("help").addEventListener("click", TC.keys);
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(document.activeElement.tagName)) return;
    const s = TC.state, run = d.run && s.mode !== "live", act = { d: TC.toggle, "?": TC.keys, "[": () => TC.step(-1), "]": () => TC.step(1),
      c: () => run && (d.history ? TC.history.compare() : TC.set({ vs: s.vs ? null : s.at.slice() })), q: () => { if (run) { const names = Object.keys(d.run.numbers); TC.set({ q: names[(names.indexOf(s.q) + 1) % names.length] }); } } }[e.key];
    if (act) { e.preventDefault(); act(); }
  });
  document.documentElement.dataset.ready = "1";
};
// One level, step, state of a path or datum on or back, by what the page shows.
TC.step = function (by) {
  const d = TC.data, s = TC.state, to = (v, count) => Math.max(0, Math.min(count - 1, v + by));
  if (d.history) TC.set({ step: to(s.step, d.history.steps) });
  else if (d.run) s.mode === "live" || TC.set({ level: to(s.level, d.run.nlevels) });
  else if (d.fit) TC.set({ datum: to(Number(s.datum) || 0, d.fit.data.value.length) });
};
TC.toggle = function () {
  const dark = document.documentElement.dataset.theme ? document.documentElement.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  TC.theme(dark ? "light" : "dark");
  TC.writeState();
  TC.draw();
};
TC.keys = function () {
  const box = document.getElementById("keys"), d = TC.data, rows = [];
  if (d.run && d.run.varied.length > 1) rows.push(["arrow keys", "move the point on the map (click the map first)"], ["shift-click", "compare with that cell"]);
  if (d.run || d.fit) rows.push(["[  ]", d.history ? "step before, step after" : d.fit ? "datum before, datum after" : "coarser, finer level"]);
  if (d.run && d.run.varied.length) rows.push(["q", "next quantity"]);
  if (d.run) rows.push(["c", d.history ? "compare with this step" : "compare with this point"]);
  rows.push(["d", "light or dark"], ["Esc", "close this"]);
  box.replaceChildren(TC.h3("Keys"), TC.el("table", { class: "facts" }, TC.el("tbody", {}, rows.map(([k, t]) => TC.el("tr", {}, TC.el("td", {}, TC.el("kbd", {}, k)), TC.el("td", {}, t))))), TC.note("The address of the page holds what is shown: copy it to come back here."), TC.el("button", { onclick: () => box.close() }, "close"));
  box.showModal();
};
TC.start().catch((error) => {
  document.getElementById("main").textContent = `The page cannot be drawn: ${error}. It needs a browser of 2023 or later.`;
  console.error(error);
});
