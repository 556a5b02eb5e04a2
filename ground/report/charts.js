// Draws every chart in the theme's colours, and again when the theme changes.
const charts = JSON.parse(document.getElementById("charts").textContent);
const theme = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue("--" + name).trim();
};
function draw() {
  const color = theme();
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
      font: { family: "Palatino, 'Palatino Linotype', Georgia, serif", size: 13, color: color("ink") },
      legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom", xanchor: "left" },
      hoverlabel: { bgcolor: color("panel"), font: { color: color("ink") } }, ...chart.layout,
    };
    for (const axis of Object.keys(layout).filter((name) => /^[xy]axis/.test(name)))
      layout[axis] = { gridcolor: color("grid"), linecolor: color("rule"), zerolinecolor: color("rule"),
                       ticks: "", ...layout[axis] };
    Plotly.react(key, data, layout, { responsive: true, displaylogo: false, displayModeBar: false });
  }
}
draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
