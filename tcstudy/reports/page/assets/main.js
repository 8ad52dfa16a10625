// Start: decode, restore the state from the address, draw, listen.
TC.draw = function () {
  const d = TC.data;
  if (d.sections) TC.sections(document.getElementById("main"), d.sections);
  else if (TC.state.mode === "live") TC.live.draw();
  else TC.run.draw();
  for (const button of document.querySelectorAll("#modes button"))
    button.setAttribute("aria-selected", String(button.value === TC.state.mode));
};
// Sections under their headings, and where the file comes from.
TC.sections = function (main, sections) {
  if (!TC.sections.hosts) {
    main.replaceChildren();
    TC.sections.hosts = sections.map((one) => TC.section(one.title, one.id));
    TC.provenance(TC.section("The study", "study"));
  }
  sections.forEach((one, k) => TC.show(TC.sections.hosts[k], one.parts));
};
TC.theme = (name) => (document.documentElement.dataset.theme = TC.state.theme = name);
TC.restore = function () {
  const given = TC.readState();
  Object.keys(TC.state).forEach((key) => delete TC.state[key]);
  if (given.theme) TC.theme(given.theme);
  if (TC.data.run) TC.run.setup(given);
  else Object.assign(TC.state, given);
};
TC.start = async function () {
  const d = (TC.data = await TC.decode(document.getElementById("data").textContent));
  const verdict = document.getElementById("verdict");
  const how = d.verdict.how;
  const kinds = {
    run: "a parametric study",
    convergence: "convergence of a study",
    cost: "accuracy against cost",
    path: "equilibria along a parameter",
    history: "a load history",
    fit: "numbers from measurements",
  };
  document.getElementById("kind").textContent = `tcstudy: ${kinds[d.kind]}`;
  verdict.classList.toggle("bad", !d.verdict.ok);
  document.getElementById("how").textContent = how ? `${how[0].toUpperCase()}${how.slice(1)}.` : "";
  TC.restore();
  const anew = () => {
    TC.run.host = TC.live.host = TC.sections.hosts = null;
    document.getElementById("main").replaceChildren();
  };
  if (d.live) {
    const nav = document.getElementById("modes");
    const go = (mode) => () => {
      anew();
      TC.set({ mode });
    };
    nav.hidden = false;
    nav.append(
      TC.el("button", { value: "", role: "tab", onclick: go("") }, "Stored results"),
      TC.el(
        "button",
        { value: "live", role: "tab", onclick: go("live") },
        "Explore live: solve here, in the browser",
      ),
    );
  }
  TC.draw();
  let width = window.innerWidth;
  let timer = null;
  window.addEventListener("resize", () => {
    if (window.innerWidth !== width) {
      width = window.innerWidth;
      clearTimeout(timer);
      timer = setTimeout(TC.draw, 120);
    }
  });
  window.addEventListener("hashchange", () => {
    TC.restore();
    anew();
    TC.draw();
  });
  document.getElementById("theme").addEventListener("click", TC.toggle);
  document.getElementById("help").addEventListener("click", TC.keys);
  document.addEventListener("keydown", (e) => {
    if (
      e.ctrlKey ||
      e.metaKey ||
      e.altKey ||
      /^(INPUT|SELECT|TEXTAREA)$/.test(document.activeElement.tagName)
    )
      return;
    const s = TC.state;
    const run = d.run && s.mode !== "live";
    const act = {
      d: TC.toggle,
      "?": TC.keys,
      "[": () => TC.step(-1),
      "]": () => TC.step(1),
      c: () => run && !d.steps && TC.set({ vs: s.vs ? null : s.at.slice() }),
      q: () => {
        if (run) {
          const names = Object.keys(d.run.numbers);
          TC.set({ q: names[(names.indexOf(s.q) + 1) % names.length] });
        }
      },
    }[e.key];
    if (act) {
      e.preventDefault();
      act();
    }
  });
  document.documentElement.dataset.ready = "1";
};
// One level, or state (a step, a vertex of a path, a datum), on or back.
TC.step = function (by) {
  const s = TC.state;
  const to = (v, count) => Math.max(0, Math.min(count - 1, v + by));
  if (TC.count) TC.set({ step: to(s.step, TC.count) });
  else if (TC.data.run && s.mode !== "live") TC.set({ level: to(s.level, TC.data.run.nlevels) });
};
TC.toggle = function () {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark"
    : matchMedia("(prefers-color-scheme: dark)").matches;
  TC.theme(dark ? "light" : "dark");
  TC.writeState();
  TC.draw();
};
TC.keys = () => document.getElementById("keys").showModal();
TC.start().catch((error) => {
  document.getElementById("main").textContent =
    `The page cannot be drawn: ${error}. It needs a browser of 2023 or later.`;
  console.error(error);
});
