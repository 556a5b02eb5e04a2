// The path of each dive in three dimensions, on a canvas, with playback.
document.addEventListener("DOMContentLoaded", () => {
  const tracks = JSON.parse(document.getElementById("track-data").textContent);
  const by = (id) => document.getElementById(id);
  const canvas = document.querySelector("#track canvas");
  const pen = canvas.getContext("2d");
  const [play, slider, clock, rate, followed, readout] =
    ["play", "time", "clock", "rate", "followed", "readout"].map(by);
  const DASHES = [[], [8, 4], [2, 3], [8, 3, 2, 3], [12, 5], [12, 4, 2, 4]];
  const view = { azimuth: -0.6, elevation: 0.5, zoom: 1 };
  let time = 0, playing = false, last = 0;

  // Bounds of all tracks: north, east and depth, m.
  const ends = (name) => [0, 1].map((side) => {
    const pick = side ? Math.max : Math.min;
    return tracks.dives.reduce((value, dive) => dive[name].reduce((v, x) => pick(v, x), value), side ? -Infinity : Infinity);
  });
  const [north, east, depth] = [ends("n"), ends("e"), ends("d")];
  depth[0] = Math.min(0, depth[0]);
  const middle = { n: (north[0] + north[1]) / 2, e: (east[0] + east[1]) / 2 };
  const reach = Math.max(north[1] - north[0], east[1] - east[0], 10);
  // Depth is stretched so that it can be seen beside a long path; the readout says by how much.
  const stretch = Math.min(10, Math.max(1, Math.round(0.2 * reach / Math.max(depth[1] - depth[0], 1))));

  const sample = (dive, at) => {
    const t = dive.t;
    let low = 0, high = t.length - 1;
    while (high - low > 1) { const half = (low + high) >> 1; if (t[half] <= at) low = half; else high = half; }
    const share = t[high] > t[low] ? Math.min(1, Math.max(0, (at - t[low]) / (t[high] - t[low]))) : 0;
    const mix = (name) => dive[name][low] + share * (dive[name][high] - dive[name][low]);
    return { index: low, n: mix("n"), e: mix("e"), d: mix("d"), roll: mix("roll"), pitch: mix("pitch"),
             yaw: mix("yaw"), rudder: mix("rudder"), elevator: mix("elevator") };
  };

  let width = 1, height = 1, scale = 1;
  const turned = (n, e, d) => {
    const [x, y] = [e - middle.e, n - middle.n];
    const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
    const up = -stretch * (d - (depth[0] + depth[1]) / 2);
    return [x * ca - y * sa, (x * sa + y * ca) * se + up * ce];
  };
  const project = (n, e, d) => {
    const [right, up] = turned(n, e, d);
    return [width / 2 + scale * right, height / 2 - scale * up];
  };
  // The box around all tracks fits into the picture, with room for the hull and the texts.
  const fit = () => {
    const corners = north.flatMap((n) => east.flatMap((e) => depth.map((d) => turned(n, e, d))));
    const [right, up] = [0, 1].map((axis) => Math.max(...corners.map((corner) => Math.abs(corner[axis])), 1));
    scale = view.zoom * Math.min((width / 2 - 50) / right, (height / 2 - 45) / up);
  };

  const path = (points) => {
    pen.beginPath();
    points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  };

  const grid = (colors) => {
    const rough = reach / 5, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * (rough / power > 5 ? 10 : rough / power > 2 ? 5 : rough / power > 1 ? 2 : 1);
    const [n0, n1] = [Math.floor(north[0] / step) * step, Math.ceil(north[1] / step) * step];
    const [e0, e1] = [Math.floor(east[0] / step) * step, Math.ceil(east[1] / step) * step];
    pen.strokeStyle = colors("rule"); pen.lineWidth = 1; pen.setLineDash([]);
    for (let n = n0; n <= n1 + 1e-6; n += step) path([project(n, e0, 0), project(n, e1, 0)]);
    for (let e = e0; e <= e1 + 1e-6; e += step) path([project(n0, e, 0), project(n1, e, 0)]);
    pen.fillStyle = colors("soft"); pen.font = "12px sans-serif"; pen.textAlign = "left";
    pen.fillText(`surface; squares of ${step} m${stretch > 1 ? `, depth × ${stretch}` : ""}`, 10, height - 10);
    // North arrow in the corner.
    const [cx, cy] = [width - 34, height - 34];
    const [a, b] = [project(0, 0, 0), project(reach, 0, 0)];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]], size = Math.hypot(dx, dy) || 1;
    pen.strokeStyle = colors("ink"); pen.lineWidth = 1.6;
    path([[cx - 16 * dx / size, cy - 16 * dy / size], [cx + 16 * dx / size, cy + 16 * dy / size]]);
    pen.fillStyle = colors("ink"); pen.textAlign = "center";
    pen.fillText("N", cx + 25 * dx / size, cy + 25 * dy / size + 4);
  };

  // Wire frame of the hull and its ring duct: stations from tail to nose, in body axes (FRD).
  const hull = (dive, pose, colors) => {
    const metres = 70 / scale; // 70 px at every zoom
    const [phi, theta, psi] = [pose.roll, pose.pitch, pose.yaw].map((angle) => angle * Math.PI / 180);
    const [cf, sf, ct, st, cp, sp] = [Math.cos(phi), Math.sin(phi), Math.cos(theta), Math.sin(theta), Math.cos(psi), Math.sin(psi)];
    const place = ([x, y, z]) => {
      const n = cp * ct * x + (cp * st * sf - sp * cf) * y + (cp * st * cf + sp * sf) * z;
      const e = sp * ct * x + (sp * st * sf + cp * cf) * y + (sp * st * cf - cp * sf) * z;
      const d = -st * x + ct * sf * y + ct * cf * z;
      return project(pose.n + metres * n, pose.e + metres * e, pose.d + metres * d / stretch);
    };
    const ring = (x, radius, turn) => Array.from({ length: 25 }, (_, k) => {
      const angle = 2 * Math.PI * k / 24;
      return place(turn([x, radius * Math.cos(angle), radius * Math.sin(angle)]));
    });
    const same = (p) => p;
    pen.setLineDash([]); pen.lineWidth = 1.4; pen.strokeStyle = colors(dive.role);
    const stations = [[-0.5, 0.03], [-0.38, 0.08], [-0.15, 0.1], [0.25, 0.1], [0.42, 0.07], [0.5, 0.01]];
    stations.forEach(([x, radius]) => path(ring(x, radius, same)));
    for (let k = 0; k < 8; k += 1) {
      const angle = Math.PI * k / 4;
      path(stations.map(([x, radius]) => place([x, radius * Math.cos(angle), radius * Math.sin(angle)])));
    }
    // The duct turns about the tail: positive rudder moves its rear edge to starboard.
    const [rudder, elevator] = [pose.rudder, pose.elevator].map((angle) => angle * Math.PI / 180);
    const bent = ([x, y, z]) => { const back = x + 0.5; return [x, y - back * Math.sin(rudder), z + back * Math.sin(elevator)]; };
    pen.lineWidth = 2;
    path(ring(-0.5, 0.11, bent)); path(ring(-0.6, 0.11, bent));
  };

  const draw = () => {
    const style = getComputedStyle(document.documentElement);
    const colors = (name) => style.getPropertyValue("--" + name).trim();
    const ratio = window.devicePixelRatio || 1;
    [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineJoin = "round";
    fit();
    grid(colors);
    tracks.dives.forEach((dive, number) => {
      const now = sample(dive, time);
      const points = dive.t.map((_, k) => project(dive.n[k], dive.e[k], dive.d[k]));
      pen.setLineDash(DASHES[number % DASHES.length]);
      pen.strokeStyle = colors(dive.role);
      pen.globalAlpha = 0.4; pen.lineWidth = 1.3; path(points);
      pen.globalAlpha = 1; pen.lineWidth = 2.4;
      path([...points.slice(0, now.index + 1), project(now.n, now.e, now.d)]);
      pen.setLineDash([1, 3]); pen.lineWidth = 1; pen.strokeStyle = colors("soft");
      path([project(now.n, now.e, 0), project(now.n, now.e, now.d)]);
      hull(dive, now, colors);
    });
    const dive = tracks.dives[Number(followed.value)];
    const now = sample(dive, time);
    const heading = ((now.yaw % 360) + 360) % 360;
    readout.textContent = `depth ${now.d.toFixed(2)} m  heading ${heading.toFixed(1)}°  pitch ${now.pitch.toFixed(1)}°`
      + (dive.surfaces ? `  rudder ${now.rudder.toFixed(1)}°  elevator ${now.elevator.toFixed(1)}°` : "");
    clock.textContent = `${time.toFixed(time < 100 ? 1 : 0)} s`;
    canvas.dataset.time = time.toFixed(2);
  };

  const show = (at) => {
    time = Math.min(tracks.end, Math.max(0, at));
    slider.value = String(Math.round(1000 * time / tracks.end));
    draw();
    window.setCursor?.(time);
  };
  const stop = () => { playing = false; play.textContent = "▶ Play"; play.setAttribute("aria-label", "Play"); };
  const tick = (now) => {
    if (!playing) return;
    show(time + Number(rate.value) * (now - last) / 1000);
    last = now;
    if (time >= tracks.end) stop(); else requestAnimationFrame(tick);
  };
  play.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (time >= tracks.end) time = 0;
    playing = true; play.textContent = "❚❚ Pause"; play.setAttribute("aria-label", "Pause");
    last = performance.now(); requestAnimationFrame(tick);
  });
  slider.addEventListener("input", () => { stop(); time = tracks.end * Number(slider.value) / 1000; draw(); window.setCursor?.(time); });
  followed.addEventListener("change", draw);
  const views = { "3d": () => { view.azimuth = -0.6; view.elevation = 0.5; }, top: () => { view.azimuth = 0; view.elevation = Math.PI / 2; },
                  side: () => { view.azimuth = 0; view.elevation = 0; }, in: () => { view.zoom *= 1.3; }, out: () => { view.zoom /= 1.3; } };
  document.querySelectorAll("[data-view]").forEach((button) =>
    button.addEventListener("click", () => { views[button.dataset.view](); draw(); }));
  let grip = null;
  canvas.addEventListener("pointerdown", (event) => { grip = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { grip = null; });
  canvas.addEventListener("pointercancel", () => { grip = null; });
  canvas.addEventListener("pointermove", (event) => {
    if (!grip) return;
    view.azimuth += 0.008 * (event.clientX - grip[0]);
    view.elevation = Math.min(Math.PI / 2, Math.max(0, view.elevation + 0.008 * (event.clientY - grip[1])));
    grip = [event.clientX, event.clientY];
    draw();
  });
  if (tracks.dives.length < 2) followed.parentElement.hidden = true;
  new ResizeObserver(draw).observe(canvas);
  window.redrawTrack = draw;
  show(0);
});
