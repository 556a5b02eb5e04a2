// Draw every chart in the theme's colours; redraw when the theme or the screen width changes.
const charts = JSON.parse(document.getElementById("charts").textContent);
const theme = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue("--" + name).trim();
};
const narrow = matchMedia("(max-width: 600px)");
const PRINTED_PX = 660; // width of a chart on A4 and on letter paper
function draw(printed = false) {
  const color = theme();
  const size = narrow.matches ? 11 : 13;
  for (const [key, chart] of Object.entries(charts)) {
    const data = chart.data.map((trace) => {
      const own = color(trace.role);
      return { ...trace, line: { ...trace.line, color: own },
               marker: { ...trace.marker, color: own, line: { ...(trace.marker || {}).line, color: own } },
               error_y: trace.error_y && { ...trace.error_y, color: own },
               fillcolor: trace.fill && own + "30" };
    });
    const layout = {
      margin: { l: 58, r: 14, t: 30, b: 44 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: "x unified",
      font: { family: "Palatino, 'Palatino Linotype', Georgia, serif", size, color: color("ink") },
      legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom", xanchor: "left",
                font: narrow.matches ? { size: 10 } : {} },
      hoverlabel: { bgcolor: color("panel"), font: { color: color("ink") } }, ...chart.layout,
    };
    if (printed) layout.width = PRINTED_PX;
    for (const axis of Object.keys(layout).filter((name) => /^[xy]axis/.test(name)))
      layout[axis] = { gridcolor: color("grid"), linecolor: color("rule"), zerolinecolor: color("rule"),
                       ticks: "", ...layout[axis] };
    // Plotly fits a responsive chart to its element: the height of the element must be given.
    const element = document.getElementById(key);
    element.style.height = `${chart.layout.height}px`;
    Plotly.react(key, data, layout, { responsive: true, displaylogo: false, displayModeBar: false });
  }
  window.redrawTrack?.();
}
// Charts over time zoom together, and have a line at the time of the playback.
const timed = Object.keys(charts).filter((key) => charts[key].time);
let cursor = null; // s
function setCursor(time) {
  cursor = time;
  for (const key of timed) {
    const element = document.getElementById(key), axis = element._fullLayout.xaxis;
    let line = element.querySelector(".cursor");
    if (!line) {
      line = document.createElement("div");
      line.className = "cursor";
      element.append(line);
    }
    const x = axis.d2p(time);
    line.hidden = !(x >= 0 && x <= axis._length);
    line.style.left = `${element.querySelector(".plot-container").offsetLeft + axis._offset + x}px`;
  }
}
draw();
for (const key of timed) {
  document.getElementById(key).on("plotly_afterplot", () => { if (cursor !== null) setCursor(cursor); });
  document.getElementById(key).on("plotly_relayout", (change) => {
    const range = change["xaxis.autorange"] ? null : [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    if (range && range[0] === undefined) return;
    for (const other of timed) {
      const now = document.getElementById(other)._fullLayout.xaxis;
      if (other === key || (range ? String(now.range) === String(range) : now.autorange)) continue;
      Plotly.relayout(other, range ? { "xaxis.range": range } : { "xaxis.autorange": true });
    }
  });
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
narrow.addEventListener("change", () => draw());
addEventListener("beforeprint", () => {
  document.querySelectorAll("details:not([open])").forEach((list) => { list.open = true; list.dataset.folded = ""; });
  document.documentElement.classList.add("printed");
  draw(true);
});
addEventListener("afterprint", () => {
  document.querySelectorAll("details[data-folded]").forEach((list) => { list.open = false; delete list.dataset.folded; });
  document.documentElement.classList.remove("printed");
  draw();
});
