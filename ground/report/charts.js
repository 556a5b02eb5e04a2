// Draw every chart in the theme's colours; redraw when the theme or the screen width changes.
const charts = JSON.parse(document.getElementById("charts").textContent);
const theme = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue("--" + name).trim();
};
const narrow = matchMedia("(max-width: 600px)");
function draw() {
  const color = theme();
  const size = narrow.matches ? 11 : 13;
  for (const [key, chart] of Object.entries(charts)) {
    const data = chart.data.map((trace) => {
      const own = color(trace.role);
      return { ...trace, line: { ...trace.line, color: own }, marker: { ...trace.marker, color: own },
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
    for (const axis of Object.keys(layout).filter((name) => /^[xy]axis/.test(name)))
      layout[axis] = { gridcolor: color("grid"), linecolor: color("rule"), zerolinecolor: color("rule"),
                       ticks: "", ...layout[axis] };
    // Plotly fits a responsive chart to its element: the height of the element must be given.
    document.getElementById(key).style.height = `${chart.layout.height}px`;
    Plotly.react(key, data, layout, { responsive: true, displaylogo: false, displayModeBar: false });
  }
}
draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
narrow.addEventListener("change", draw);
