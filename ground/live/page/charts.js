// Drawing on canvases that keep their height: sizes, strips over time, and the map.

const STYLE = getComputedStyle(document.documentElement);
export const colour = (name) => STYLE.getPropertyValue(`--${name}`).trim();

// Return the context of a canvas whose pixels match its box; one unit is one CSS pixel.
export function prepare(canvas) {
  const box = canvas.parentElement;
  const [width, height, ratio] = [box.clientWidth, box.clientHeight, window.devicePixelRatio || 1];
  const [columns, lines] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== columns || canvas.height !== lines) [canvas.width, canvas.height] = [columns, lines];
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = '12px system-ui, sans-serif';
  return { context, width, height };
}

// Return a step of 1, 2 or 5 times a power of ten for about `count` intervals.
export function step(span, count) {
  const raw = Math.max(span, 1e-9) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= raw);
}

// Return a step in degrees that divides a quarter of a turn, or is a multiple of a turn.
export const turnStep = (span) => [1, 2, 5, 10, 15, 30, 45, 90, 180].find((value) => value >= span / 4) || 360 * Math.ceil(span / 4 / 360);

const format = (value, size) => value.toFixed(Math.max(0, -Math.floor(Math.log10(size) + 1e-9)));

// Draw a strip: series are {column, colour, dashed}; rows are arrays of numbers or null.
export function drawStrip(canvas, rows, series, seconds, options) {
  const { context, width, height } = prepare(canvas);
  const [left, right, top, bottom] = [44, width - 8, 6, height - 18];
  const last = rows.length ? rows[rows.length - 1][0] : 0;
  const oldest = Math.min(rows.length ? rows[0][0] : 0, last - 10);
  const first = seconds ? Math.max(oldest, last - seconds) : oldest;
  let start = rows.length;
  while (start > 0 && rows[start - 1][0] >= first) start -= 1;
  start = Math.max(0, start - 1);
  let [low, high] = [Infinity, -Infinity];
  for (const { column } of series) {
    for (let index = start; index < rows.length; index += 1) {
      const value = rows[index][column];
      if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
    }
  }
  if (low > high) [low, high] = [0, options.span];
  if (high - low < options.span) { const middle = (low + high) / 2; [low, high] = [middle - options.span / 2, middle + options.span / 2]; }
  const margin = 0.06 * (high - low);
  [low, high] = [low - margin, high + margin];
  const x = (time) => left + (time - first) / Math.max(last - first, 1e-6) * (right - left);
  const y = (value) => {
    const share = (value - low) / (high - low);
    return options.down ? top + share * (bottom - top) : bottom - share * (bottom - top);
  };
  context.strokeStyle = colour('grid'); context.fillStyle = colour('soft'); context.lineWidth = 1;
  context.textAlign = 'right'; context.textBaseline = 'middle';
  const size = options.turns ? turnStep(high - low) : step(high - low, 4);
  for (let value = Math.ceil(low / size) * size; value <= high; value += size) {
    context.beginPath(); context.moveTo(left, y(value)); context.lineTo(right, y(value)); context.stroke();
    context.fillText(format(options.turns ? ((value % 360) + 360) % 360 : value, size), left - 6, y(value));
  }
  context.textAlign = 'center'; context.textBaseline = 'alphabetic';
  const interval = step(last - first, Math.max(2, width / 110));
  for (let time = Math.ceil(first / interval) * interval; time <= last; time += interval) {
    if (time < 0) continue;
    context.beginPath(); context.moveTo(x(time), top); context.lineTo(x(time), bottom); context.stroke();
    if (x(time) > left + 12 && x(time) < right - 14) context.fillText(`${format(time, interval)} s`, x(time), height - 4);
  }
  context.save();
  context.beginPath(); context.rect(left, top - 2, right - left, bottom - top + 4); context.clip();
  context.lineJoin = 'round';
  const stride = Math.max(1, Math.floor((rows.length - start) / (3 * width)));
  for (const { column, colour: name, dashed } of series) {
    context.strokeStyle = colour(name); context.lineWidth = dashed ? 1.5 : 1.8;
    context.setLineDash(dashed ? [5, 4] : []);
    context.beginPath();
    let before = null;
    for (let index = start; index < rows.length; index += 1) {
      if (index % stride && index !== rows.length - 1) continue;
      const value = rows[index][column];
      if (value !== null) {
        context[before === null ? 'moveTo' : 'lineTo'](x(rows[index][0]), y(value));
      }
      before = value;
    }
    context.stroke();
  }
  context.restore();
}

// Draw the map: rows give the track in columns `north` and `east`; plan as of the server.
export function drawMap(canvas, rows, columns, plan, sequence) {
  const { context, width, height } = prepare(canvas);
  const [north, east, heading] = [columns.north_m, columns.east_m, columns.heading_deg];
  const points = [[-15, -15], [15, 15]];
  for (const row of rows) if (row[north] !== null) points.push([row[north], row[east]]);
  for (const point of plan.waypoints) points.push([point.north_m, point.east_m]);
  for (const zone of plan.zones) {
    for (const [n, e] of zone.points) points.push([n - zone.radius_m, e - zone.radius_m], [n + zone.radius_m, e + zone.radius_m]);
  }
  let [south, top, west, right] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [n, e] of points) { south = Math.min(south, n); top = Math.max(top, n); west = Math.min(west, e); right = Math.max(right, e); }
  const scale = Math.min((width - 60) / (right - west), (height - 48) / (top - south));
  const [centreNorth, centreEast] = [(south + top) / 2, (west + right) / 2];
  const x = (e) => width / 2 + (e - centreEast) * scale;
  const y = (n) => height / 2 - (n - centreNorth) * scale;
  context.fillStyle = colour('sea'); context.fillRect(0, 0, width, height);
  const size = step(width / scale, width / 90);
  context.lineWidth = 1; context.strokeStyle = colour('rule'); context.fillStyle = colour('soft');
  context.textAlign = 'center';
  const fromEast = centreEast - width / 2 / scale; const fromNorth = centreNorth - height / 2 / scale;
  for (let e = Math.ceil(fromEast / size) * size; x(e) < width; e += size) {
    context.beginPath(); context.moveTo(x(e), 0); context.lineTo(x(e), height); context.stroke();
    if (x(e) > 26 && x(e) < width - 34) context.fillText(`${format(e, size)} m E`, x(e), height - 5);
  }
  context.textAlign = 'left';
  for (let n = Math.ceil(fromNorth / size) * size; y(n) > 0; n += size) {
    context.beginPath(); context.moveTo(0, y(n)); context.lineTo(width, y(n)); context.stroke();
    if (y(n) > 14 && y(n) < height - 22) context.fillText(`${format(n, size)} m N`, 4, y(n) - 3);
  }
  drawZones(context, plan.zones, x, y, scale);
  drawWaypoints(context, plan.waypoints, x, y, sequence);
  context.strokeStyle = colour('one'); context.lineWidth = 2; context.lineJoin = 'round'; context.setLineDash([]);
  context.beginPath();
  let drawn = false; let last = null;
  for (const row of rows) {
    if (row[north] === null) continue;
    context[drawn ? 'lineTo' : 'moveTo'](x(row[east]), y(row[north]));
    [drawn, last] = [true, row];
  }
  context.stroke();
  if (last) drawArrow(context, x(last[east]), y(last[north]), last[heading]);
}

function drawZones(context, zones, x, y, scale) {
  for (const zone of zones) {
    context.beginPath();
    if (zone.radius_m > 0) {
      const [n, e] = zone.points[0];
      context.arc(x(e), y(n), zone.radius_m * scale, 0, 2 * Math.PI);
    } else {
      zone.points.forEach(([n, e], index) => context[index ? 'lineTo' : 'moveTo'](x(e), y(n)));
      context.closePath();
    }
    context.strokeStyle = colour('zone'); context.lineWidth = 1.8; context.setLineDash(zone.inclusion ? [9, 4] : []);
    if (!zone.inclusion) { context.fillStyle = colour('zone'); context.globalAlpha = 0.18; context.fill(); context.globalAlpha = 1; }
    context.stroke();
  }
  context.setLineDash([]);
}

function drawWaypoints(context, waypoints, x, y, sequence) {
  context.strokeStyle = colour('set'); context.lineWidth = 1.2; context.setLineDash([3, 4]);
  context.beginPath();
  waypoints.forEach((point, index) => context[index ? 'lineTo' : 'moveTo'](x(point.east_m), y(point.north_m)));
  context.stroke(); context.setLineDash([]);
  const next = waypoints.findIndex((point) => sequence !== null && point.sequence >= sequence);
  const drawPoint = (point, name, fill) => {
    context.beginPath(); context.arc(x(point.east_m), y(point.north_m), 5, 0, 2 * Math.PI);
    context.fillStyle = colour(fill); context.fill();
    context.strokeStyle = colour(name); context.lineWidth = 1.6; context.stroke();
  };
  waypoints.forEach((point) => drawPoint(point, 'set', 'panel'));
  if (next >= 0) drawPoint(waypoints[next], 'two', 'two');
  context.fillStyle = colour('ink'); context.textAlign = 'left';
  for (const { text, left, base } of readable(waypoints, x, y, next)) context.fillText(text, left, base);
}

// Return the numbers of waypoints that do not cover each other, with their places; the next waypoint has precedence.
export function readable(waypoints, x, y, next) {
  const order = [...waypoints.keys()].sort((a, b) => (b === next) - (a === next));
  const numbers = [];
  for (const index of order) {
    const text = String(index + 1);
    const [left, base] = [x(waypoints[index].east_m) + 8, y(waypoints[index].north_m) - 7];
    const right = left + 7 * text.length + 4;
    if (numbers.every((other) => Math.abs(other.base - base) > 12 || other.left > right || other.right < left)) numbers.push({ text, left, right, base });
  }
  return numbers;
}

function drawArrow(context, x, y, headingDeg) {
  context.save(); context.translate(x, y); context.rotate((headingDeg || 0) * Math.PI / 180);
  context.beginPath(); context.moveTo(0, -12); context.lineTo(7, 9); context.lineTo(0, 5); context.lineTo(-7, 9); context.closePath();
  context.fillStyle = colour('hull'); context.fill(); context.strokeStyle = colour('ink'); context.lineWidth = 1.2; context.stroke();
  context.restore();
}
