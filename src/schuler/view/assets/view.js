"use strict";
(() => {
  const at = (id) => document.getElementById(id);
  const shown = { file: null, kind: null, from: 0, to: 0, drawn: 0 };
  let running = false;

  const make = (tag, text, more = {}) => Object.assign(document.createElement(tag), { textContent: text }, more);
  const complain = (text) => { at("error").textContent = text || ""; at("error").hidden = !text; };
  const ask = async (path, query, body) => {
    const how = body ? { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } } : {};
    const answer = await fetch(path + (query ? "?" + new URLSearchParams(query) : ""), how);
    const text = await answer.text();
    let said;
    try { said = JSON.parse(text); } catch { throw new Error(text || "no answer"); }
    if (said.error) throw new Error(said.error);
    return said;
  };
  const trying = (work) => async (...given) => {
    try { complain(); return await work(...given); } catch (error) { complain(error.message); }
  };
  const chosen = () => ({ gyro_unit: at("gyro_unit").value, accel_unit: at("accel_unit").value, rate: at("rate").value });

  // ---- the list of files -------------------------------------------------------------------
  const entry = (name, open, ticked) => {
    const item = make("li", "");
    if (ticked) item.append(make("input", "", { type: "checkbox", value: name, onchange: tick, ariaLabel: "Compare " + name }));
    const button = make("button", name, { onclick: () => open(name) });
    button.dataset.name = name;
    item.append(button);
    return item;
  };
  const ticked = () => [...document.querySelectorAll("#numbers input:checked")].map((box) => box.value);
  const tick = () => { at("compare").disabled = ticked().length < 2; };
  const mark = (name) => document.querySelectorAll("aside li button").forEach((b) => b.setAttribute("aria-current", String(b.dataset.name === name)));
  const fill = (select, names, first) => {
    const before = select.value;
    select.replaceChildren(...(first === null ? [] : [make("option", first, { value: "" })]), ...names.map((n) => make("option", n, { value: n })));
    if (names.includes(before)) select.value = before;
  };
  const list = trying(async () => {
    const found = await ask("/api/files");
    const kept = ticked();
    at("folder").textContent = found.folder;
    document.title = found.folder + " · schuler view";
    for (const [id, open] of [["recordings", pick], ["pages", page], ["numbers", twin]]) {
      at(id).replaceChildren(...found[id].map((name) => entry(name, open, id === "numbers")));
      if (!found[id].length) at(id).append(make("li", "None.", { className: "none" }));
    }
    document.querySelectorAll("#numbers input").forEach((box) => { box.checked = kept.includes(box.value); });
    tick();
    mark(shown.file);
    const satellites = (name) => /gnss|gps|\.pos$|\.nmea$|\.ubx$/i.test(name);
    const sorted = [...found.recordings].sort((a, b) => satellites(b) - satellites(a));
    fill(at("gnss"), sorted, null);
    fill(at("imu"), [...sorted].sort((a, b) => satellites(a) - satellites(b)), null);
    fill(at("noise"), found.models, "none: tuned by the drive");
  });
  const only = (id) => ["welcome", "recording", "page"].forEach((one) => { at(one).hidden = one !== id; });
  const page = (name) => {
    shown.file = name;
    mark(name);
    only("page");
    at("page").src = "/page?" + new URLSearchParams({ file: name });
    scrollTo(0, 0);
  };
  const twin = (name) => {
    const other = name.replace(/\.json$/i, ".html");
    const there = [...document.querySelectorAll("#pages button")].some((b) => b.dataset.name === other);
    if (there) page(other); else complain(name + " has no page beside it; tick two results to compare them");
  };

  // ---- one recording -----------------------------------------------------------------------
  const pick = trying(async (name) => {
    if (name !== shown.file) ["gyro_unit", "accel_unit", "rate"].forEach((id) => { at(id).value = ""; });
    shown.file = name;
    mark(name);
    only("recording");
    at("name").textContent = name;
    at("facts").textContent = "Reading ...";
    at("assumed").hidden = true;
    Plotly.purge("plot");
    Plotly.purge("track");
    at("outage").disabled = true;
    let found;
    try { found = await ask("/api/recording", { file: name, ...chosen() }); } catch (error) { at("facts").textContent = "Not read."; throw error; }
    if (shown.file !== name) return;
    Object.assign(shown, { kind: found.kind, from: found.start, to: found.stop });
    at("facts").textContent = Object.entries(found.facts).map(([key, value]) => `${key} ${value}`).join(" · ");
    at("assumed").hidden = !found.assumptions.length;
    at("assumed").querySelector("ul").replaceChildren(...found.assumptions.map((line) => make("li", line, { className: "note" })));
    at("units").hidden = found.kind !== "imu";
    at(found.kind).value = name;
    await draw(found.start, found.stop);
    at("outage").disabled = false;
    if (found.track) drawTrack(found.track);
  });
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const axis = (more) => ({ gridcolor: colour("--line"), zerolinecolor: colour("--line"), linecolor: colour("--line"), exponentformat: "none", automargin: true, ...more });
  const look = (more) => ({
    autosize: true, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 60, r: 16, t: 24, b: 40 },
    font: { color: colour("--ink"), size: 12, family: getComputedStyle(document.body).fontFamily }, legend: { orientation: "h", y: 1.08 }, ...more,
  });
  const config = { displayModeBar: false, responsive: true, showTips: false };
  const draw = async (from, to) => {
    const number = ++shown.drawn;
    const found = await ask("/api/series", { file: shown.file, start: from, stop: to, ...chosen() });
    if (number !== shown.drawn) return;
    Object.assign(shown, { from, to });
    const traces = [], layout = look({ xaxis: axis({ title: { text: "Time in s" }, range: [from, to], anchor: "y" + (found.groups.length > 1 ? found.groups.length : "") }), uirevision: shown.file });
    found.groups.forEach((group, row) => {
      const suffix = row ? String(row + 1) : "", share = 1 / found.groups.length;
      layout["yaxis" + suffix] = axis({ title: { text: group.title }, domain: [1 - share * (row + 1) + (row + 1 < found.groups.length ? 0.05 : 0), 1 - share * row] });
      group.lines.forEach((line, k) => traces.push({
        type: "scatter", mode: "lines", name: line.name, x: found.x, y: line.y, xaxis: "x", yaxis: "y" + suffix,
        line: { width: 1, color: colour(["--x", "--y", "--z"][k % 3]) }, hovertemplate: "%{x:.6~f} s, %{y:.6~g}",
      }));
    });
    await Plotly.react("plot", traces, layout, config);
    Plotly.Plots.resize("plot"); // in a narrow window the first drawing is too wide
    at("plot").removeAllListeners("plotly_relayout");
    at("plot").on("plotly_relayout", zoomed);
  };
  const zoomed = trying(async (change) => {
    if (change["xaxis.autorange"]) await pick(shown.file);
    else if ("xaxis.range[0]" in change) await draw(Number(change["xaxis.range[0]"]), Number(change["xaxis.range[1]"]));
  });
  const drawTrack = async (track) => { await Plotly.react("track",
    [{ type: "scatter", mode: "lines", x: track.east, y: track.north, line: { width: 1.5, color: colour("--x") }, hovertemplate: "%{x:.1f} m east, %{y:.1f} m north" }],
    look({ xaxis: axis({ title: { text: "East in m" } }), yaxis: axis({ title: { text: "North in m" }, scaleanchor: "x" }) }), config); Plotly.Plots.resize("track"); };

  // ---- jobs --------------------------------------------------------------------------------
  const job = (one) => {
    const item = make("li", ""), row = make("div", "", { className: "row" });
    row.append(make("span", one.state, { className: "state " + one.state }), make("span", one.title));
    if (one.state === "done") row.append(make("button", "Open", { className: "quiet", onclick: () => page(one.page) }));
    if (["waiting", "running"].includes(one.state)) row.append(make("button", "Stop", { className: "quiet", onclick: trying(() => ask("/api/stop", null, { number: one.number })) }));
    item.append(row);
    if (one.progress && one.state === "running") item.append(make("p", one.progress, { className: "note" }));
    one.notes.slice(one.state === "failed" ? -3 : 0).forEach((line) => item.append(make("p", line, { className: "note" })));
    return item;
  };
  const watch = trying(async () => {
    const jobs = await ask("/api/jobs");
    if (jobs.length) at("jobs").replaceChildren(...jobs.map(job));
    const busy = jobs.some((one) => ["waiting", "running"].includes(one.state));
    if (running && !busy) await list();
    running = busy;
    if (busy) setTimeout(watch, 700);
  });
  const start = (wanted) => trying(async () => {
    const job = wanted(); // how to read is said of the recording that is shown
    await ask("/api/jobs", null, { ...(job.imu === shown.file ? chosen() : {}), ...job });
    if (!running) { running = true; await watch(); }
  });
  at("characterize").onclick = start(() => ({ verb: "characterize", imu: shown.file }));
  at("navigate").onclick = start(() => ({ verb: "navigate", imu: at("imu").value, gnss: at("gnss").value, noise: at("noise").value, windows: at("windows").value }));
  at("compare").onclick = start(() => ({ verb: "compare", results: ticked() }));
  at("outage").onclick = trying(async () => {
    const satellites = await ask("/api/recording", { file: at("gnss").value });
    const begin = Math.max(shown.from - satellites.start, 0), seconds = shown.to - satellites.start - begin;
    if (!(seconds > 0)) throw new Error("GNSS was not recorded there");
    at("windows").value = `${at("windows").value} ${begin.toFixed(1)}:${seconds.toFixed(1)}`.trim();
  });
  ["gyro_unit", "accel_unit", "rate"].forEach((id) => { at(id).onchange = () => pick(shown.file); });
  at("refresh").onclick = list;
  list().then(watch);
})();
