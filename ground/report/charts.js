// Draw every chart in the theme's colours; redraw when the theme or the screen width changes.
const charts = JSON.parse(document.getElementById("charts").textContent);
const theme = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue("--" + name).trim();
};
const narrow = matchMedia("(max-width: 600px)");
const PRINTED_PX = 660; // width of a chart on A4 and on letter paper
const PRINTED_HEIGHT = 0.8; // height over that on the screen: the tallest chart fits on a page with its heading
const PRINTED_COMPACT_PX = 325; // width of a chart that is printed beside another one
const PRINTED_ROW_PX = 355; // maximum height of a chart that stands beside others on the screen: two fit on a page
const keys = [...document.querySelectorAll(".chart")].map((element) => element.id).filter((key) => key in charts);
// While a page is printed, theme and width may change too: its charts keep the sizes of the paper.
const printing = () => document.documentElement.classList.contains("printed");
function drawChart(key) {
  const color = theme(), chart = charts[key], printed = printing();
  const size = narrow.matches || printed ? 11 : 13;
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
    legend: { orientation: "h", x: 0, y: 1, yref: "container", yanchor: "top", xanchor: "left",
              font: narrow.matches ? { size: 10 } : {} },
    hoverlabel: { bgcolor: color("panel"), font: { color: color("ink") } }, ...chart.layout,
  };
  if (printed) {
    const place = document.getElementById(key);
    layout.width = place.closest(".compact") ? PRINTED_COMPACT_PX : PRINTED_PX;
    layout.height *= PRINTED_HEIGHT;
    if (place.closest(".pair, .triple")) layout.height = Math.min(layout.height, PRINTED_ROW_PX);
  }
  for (const axis of Object.keys(layout).filter((name) => /^[xy]axis/.test(name)))
    layout[axis] = { gridcolor: color("grid"), linecolor: color("rule"), zerolinecolor: color("rule"),
                     ticks: "", ...layout[axis] };
  // Titles stand beside the longest tick label of their axis, and the margin has room for both.
  for (const axis of Object.keys(layout).filter((name) => name.startsWith("yaxis") && layout[name].title))
    layout[axis] = { automargin: "left", ...layout[axis], title: { standoff: 6, ...layout[axis].title } };
  // Plotly fits a responsive chart to its element: the height of the element must be given.
  const element = document.getElementById(key);
  element.style.height = `${layout.height}px`;
  Plotly.react(key, data, layout, { responsive: true, displaylogo: false, displayModeBar: false });
}
function draw() {
  for (const key of keys) drawChart(key);
  window.redrawTrack?.();
}
// Charts over time zoom together, and have a line at the time of the playback.
const timed = keys.filter((key) => charts[key].time);
let cursor = null; // s
function setCursor(time) {
  cursor = time;
  for (const key of timed) {
    const element = document.getElementById(key), axis = element._fullLayout?.xaxis;
    if (!axis) continue; // not drawn yet
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
function connect(key) {
  document.getElementById(key).on("plotly_afterplot", () => { if (cursor !== null) setCursor(cursor); });
  document.getElementById(key).on("plotly_relayout", (change) => {
    const range = change["xaxis.autorange"] ? null : [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    if (range && range[0] === undefined) return;
    for (const other of timed) {
      const now = document.getElementById(other)._fullLayout?.xaxis;
      if (!now || other === key || (range ? String(now.range) === String(range) : now.autorange)) continue;
      Plotly.relayout(other, range ? { "xaxis.range": range } : { "xaxis.autorange": true });
    }
  });
}
// A chart is shown before the next one is drawn: the first one does not wait for the last.
async function begin() {
  for (const key of keys) document.getElementById(key).style.height = `${charts[key].layout.height}px`;
  for (const key of keys) {
    if (!document.getElementById(key)._fullLayout) drawChart(key);
    if (timed.includes(key)) connect(key);
    await new Promise((next) => setTimeout(next));
  }
  document.documentElement.dataset.drawn = "";
}
begin();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
narrow.addEventListener("change", () => draw());
addEventListener("beforeprint", () => {
  document.querySelectorAll("details:not([open])").forEach((list) => { list.open = true; list.dataset.folded = ""; });
  document.documentElement.classList.add("printed");
  draw();
});
addEventListener("afterprint", () => {
  document.querySelectorAll("details[data-folded]").forEach((list) => { list.open = false; delete list.dataset.folded; });
  document.documentElement.classList.remove("printed");
  draw();
});
