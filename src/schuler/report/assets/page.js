"use strict";
(() => {
  const plots = [...document.querySelectorAll(".plot")];
  const palette = () => getComputedStyle(document.documentElement);
  const colour = (styles, name) => {
    const [token, opacity] = name.slice(1).split("/");
    const hex = styles.getPropertyValue("--" + token).trim() || "#888888";
    if (opacity === undefined) return hex;
    const part = (k) => parseInt(hex.slice(k, k + 2), 16);
    return `rgba(${part(1)},${part(3)},${part(5)},${opacity})`;
  };
  // Colours are "@name" or "@name/opacity"; everything else stays as it is.
  const dress = (value, styles) => {
    if (typeof value === "string") return /^@[a-z]+(\/[\d.]+)?$/.test(value) ? colour(styles, value) : value;
    if (Array.isArray(value)) return value.map((v) => dress(v, styles));
    if (value && typeof value === "object") {
      if ("bdata" in value) return value;
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, dress(v, styles)]));
    }
    return value;
  };
  const dressKeys = () => {
    const styles = palette();
    for (const [attribute, data] of [["fill", "data-fill"], ["stroke", "data-stroke"]]) {
      document.querySelectorAll(`[${data}]`).forEach((e) => e.setAttribute(attribute, colour(styles, e.getAttribute(data))));
    }
  };
  const template = (styles) => {
    const v = (name) => styles.getPropertyValue("--" + name).trim();
    const axis = {
      gridcolor: v("grid"), linecolor: v("line"), zerolinecolor: v("line"), zerolinewidth: 1,
      tickcolor: v("line"), ticks: "outside", ticklen: 4, showline: true, automargin: true,
      title: { standoff: 8, font: { size: 12, color: v("soft") } }, tickfont: { size: 11, color: v("soft") },
    };
    return { layout: {
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: v("ink") },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
      margin: { l: 56, r: 10, t: 10, b: 44 }, hovermode: "closest", dragmode: "zoom",
      hoverlabel: { bgcolor: v("card"), bordercolor: v("line"), font: { color: v("ink"), size: 12 } },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: v("soft"), activecolor: v("ink") },
      xaxis: axis, yaxis: axis,
    } };
  };
  const data = new Map();
  let printing = false;
  // Paper is laid out after the plots are drawn, so their widths are told: A4 less its margins.
  const PAPER = 698, GAP = 13;
  const paperWidth = (element) => {
    const columns = Number(/columns-(\d)/.exec(element.closest(".grid").className)[1]);
    return Math.floor((PAPER - (columns - 1) * GAP) / columns);
  };
  // A plot follows its column, also when a scroll bar appears or a page is turned.
  const sizes = "ResizeObserver" in window
    ? new ResizeObserver((entries) => {
        if (!printing) for (const e of entries) if (e.contentRect.width) Plotly.Plots.resize(e.target);
      })
    : null;
  // A map, both axes in metres to one scale, has a bar of 1, 2 or 5 tens that follows the zoom.
  const bar = (element) => {
    const { xaxis, yaxis } = element._fullLayout;
    if (yaxis.scaleanchor !== "x" || !/ in m$/.test(xaxis.title.text)) return;
    const seen = Math.abs(xaxis.range[1] - xaxis.range[0]), ten = 10 ** Math.floor(Math.log10(seen / 4));
    const metres = ten * [5, 2, 1].find((k) => k * ten <= seen / 4), share = metres / seen;
    if (!(share > 0) || element.dataset.bar === share.toPrecision(4)) return;
    element.dataset.bar = share.toPrecision(4);
    const [size, unit] = metres >= 1000 ? [metres / 1000, "km"] : metres >= 1 ? [metres, "m"] : metres >= 0.01 ? [100 * metres, "cm"] : [1000 * metres, "mm"];
    const ink = palette().getPropertyValue("--ink").trim(), own = data.get(element.dataset.figure).layout;
    const where = { xref: "x domain", yref: "y domain" }, line = { color: ink, width: 1.5 }, left = 0.025, low = 0.04;
    const stroke = (x0, x1, y1) => ({ type: "line", ...where, x0, x1, y0: low, y1, line });
    Plotly.relayout(element, {
      shapes: [...dress(own.shapes || [], palette()), stroke(left, left + share, low), stroke(left, left, low + 0.02), stroke(left + share, left + share, low + 0.02)],
      annotations: [...dress(own.annotations || [], palette()), { ...where, x: left + share / 2, y: low, xanchor: "center", yanchor: "bottom", showarrow: false, text: `${Number(size.toPrecision(1))} ${unit}`, font: { color: ink, size: 11 } }],
    });
  };
  const draw = (element) => {
    const k = element.dataset.figure;
    if (!data.has(k)) data.set(k, JSON.parse(document.getElementById("figure-" + k).textContent));
    const figure = data.get(k), styles = palette();
    const size = printing ? { autosize: false, width: paperWidth(element) } : { autosize: true };
    const layout = { ...dress(figure.layout, styles), template: template(styles), height: figure.height, ...size };
    const first = !element.dataset.drawn;
    if (first && sizes) sizes.observe(element);
    element.dataset.drawn = "yes";
    element.dataset.bar = "";
    const done = Plotly.react(element, dress(figure.traces, styles), layout, {
      displayModeBar: printing ? false : "hover", modeBarButtons: [["toImage"]], displaylogo: false,
      toImageButtonOptions: { format: "svg" }, responsive: !printing, showTips: false,
    });
    return done.then(() => { if (first) element.on("plotly_relayout", () => bar(element)); bar(element); });
  };
  const redraw = () => { dressKeys(); plots.filter((p) => p.dataset.drawn).forEach(draw); };
  const drawAll = () => { dressKeys(); plots.forEach(draw); };
  dressKeys();
  // On a phone a table wider than the page becomes a card a row, every value behind its heading.
  const narrow = matchMedia("(max-width: 40rem)");
  const deal = () => {
    if (!narrow.matches) return;
    for (const box of document.querySelectorAll(".table:not(.cards)")) {
      if (box.scrollWidth <= box.clientWidth + 1 || box.querySelector(".verdicts")) continue;
      const headings = [...box.querySelectorAll("thead th")].map((h) => h.textContent.trim());
      for (const row of box.querySelectorAll("tbody tr")) [...row.children].forEach((cell, k) => { cell.dataset.label = headings[k] || ""; });
      box.classList.add("cards");
      if (box.scrollWidth > box.clientWidth + 1) box.classList.add("tall");
    }
  };
  deal();
  narrow.addEventListener("change", deal);
  document.querySelectorAll("details").forEach((d) => d.addEventListener("toggle", deal));
  if (typeof Plotly === "undefined") return;
  if ("IntersectionObserver" in window) {
    const watcher = new IntersectionObserver((entries) => {
      for (const entry of entries) if (entry.isIntersecting) { watcher.unobserve(entry.target); draw(entry.target); }
    }, { rootMargin: "600px" });
    plots.forEach((p) => watcher.observe(p));
  } else drawAll();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  const folded = [...document.querySelectorAll("details:not([open])")];
  addEventListener("beforeprint", () => {
    printing = true;
    folded.forEach((d) => { d.dataset.folded = d.open ? "" : "yes"; d.open = true; });
    drawAll();
  });
  addEventListener("afterprint", () => {
    printing = false;
    folded.forEach((d) => { d.open = d.dataset.folded !== "yes"; });
    redraw();
  });
})();
