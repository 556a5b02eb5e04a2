// Hull with ring duct in three dimensions: flat faces, sorted by distance, on a plain canvas.
//
// Body axes: x forward, y to starboard, z down, origin at mid-length; lengths in metres (Caribou:
// 3.54 m long, 0.53 m thick). The camera keeps its place behind the vehicle, so that the duct is
// always seen; a compass disc below turns with the heading. Positive rudder turns the nose to
// starboard, positive elevator turns it up: the rear edge of the duct moves to starboard, or up.

import { colour, prepare } from './charts.js';

const PARTS = 32;
const PROFILE = [[1.77, 0.0], [1.74, 0.07], [1.66, 0.13], [1.5, 0.19], [1.25, 0.235], [0.95, 0.26], [0.5, 0.267], [0, 0.267],
  [-0.5, 0.265], [-0.8, 0.25], [-1.05, 0.217], [-1.3, 0.165], [-1.5, 0.112], [-1.7, 0.052], [-1.77, 0.03]];
const DUCT = { x: -1.72, radius: 0.235, chord: 0.17 };
const LIGHT = [-0.35, -0.45, -0.82];
const rad = Math.PI / 180;

function circle(x, radius) {
  return Array.from({ length: PARTS }, (_, index) => {
    const angle = 2 * Math.PI * index / PARTS;
    return [x, radius * Math.cos(angle), radius * Math.sin(angle)];
  });
}

function tube(rings, closedBack) {
  const faces = [];
  for (let ring = 0; ring + 1 < rings.length; ring += 1) {
    for (let part = 0; part < PARTS; part += 1) {
      const next = (part + 1) % PARTS;
      faces.push([rings[ring][part], rings[ring][next], rings[ring + 1][next], rings[ring + 1][part]]);
    }
  }
  if (closedBack) faces.push(rings[rings.length - 1]);
  return faces;
}

const HULL = tube(PROFILE.map(([x, radius]) => circle(x, radius)), true);
const FIN = [[[0.95, 0, -0.25], [0.7, 0, -0.42], [0.5, 0, -0.42], [0.45, 0, -0.25]]];
const RING = tube([circle(DUCT.chord / 2, DUCT.radius), circle(-DUCT.chord / 2, DUCT.radius)], false);
const STRUTS = [0, 1, 2, 3].map((quarter) => {
  const [c, s] = [Math.cos(quarter * Math.PI / 2), Math.sin(quarter * Math.PI / 2)];
  return [[0.04, 0.05 * c, 0.05 * s], [0.04, DUCT.radius * c, DUCT.radius * s], [-0.04, DUCT.radius * c, DUCT.radius * s], [-0.04, 0.05 * c, 0.05 * s]];
});

// Return the matrix of yaw, pitch and roll (rad), in that order, from body to level axes.
function rotation(yaw, pitch, roll) {
  const [cy, sy, cp, sp, cr, sr] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch), Math.cos(roll), Math.sin(roll)];
  return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], [-sp, cp * sr, cp * cr]];
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const turn = (matrix, [x, y, z]) => matrix.map((row) => row[0] * x + row[1] * y + row[2] * z);

export class HullView {
  constructor(canvas) {
    this.canvas = canvas;
    [this.azimuth, this.elevation] = [152 * rad, 20 * rad];
    this.state = { heading: 0, pitch: 0, roll: 0, rudder: 0, elevator: 0 };
    let from = null;
    canvas.addEventListener('pointerdown', (event) => { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener('pointerup', () => { from = null; });
    canvas.addEventListener('pointercancel', () => { from = null; });
    canvas.addEventListener('pointermove', (event) => {
      if (!from) return;
      this.azimuth += (event.clientX - from[0]) * 0.008;
      this.elevation = Math.min(1.4, Math.max(-0.3, this.elevation + (event.clientY - from[1]) * 0.006));
      from = [event.clientX, event.clientY];
      this.draw();
    });
  }

  show(state) {
    this.state = state;
    this.draw();
  }

  draw() {
    const { context, width, height } = prepare(this.canvas);
    const { heading, pitch, roll, rudder, elevator } = this.state;
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    // the camera looks along `ahead`; `right` and `up` span the picture; level axes have z down
    const ahead = [-ca * ce, -sa * ce, se];
    const right = [sa, -ca, 0];
    const up = [-ca * se, -sa * se, -ce];
    const [distance, scale] = [6.6, Math.min(width * 1.5, height * 2.0)];
    const project = (point) => {
      const depth = distance + dot(ahead, point);
      return [width / 2 + dot(right, point) / depth * scale, height * 0.42 - dot(up, point) / depth * scale, depth];
    };
    this.drawCompass(context, project, heading);
    const body = rotation(0, pitch * rad, roll * rad);
    const duct = rotation(-rudder * rad, -elevator * rad, 0);
    const moved = (point) => { const [x, y, z] = turn(duct, point); return turn(body, [x + DUCT.x, y, z]); };
    const solids = [
      ...HULL.map((face) => ({ points: face.map((point) => turn(body, point)), name: 'hull', closed: true })),
      ...FIN.map((face) => ({ points: face.map((point) => turn(body, point)), name: 'hull' })),
      ...[...RING, ...STRUTS].map((face) => ({ points: face.map(moved), name: 'duct' })),
    ];
    const drawn = [];
    for (const { points, name, closed } of solids) {
      const flat = points.map(project);
      let area = 0;
      flat.forEach(([x, y], index) => { const [nx, ny] = flat[(index + 1) % flat.length]; area += x * ny - nx * y; });
      if (closed && area <= 0) continue;
      drawn.push({ flat, name, light: shade(points, ahead), depth: flat.reduce((sum, point) => sum + point[2], 0) / flat.length });
    }
    drawn.sort((a, b) => b.depth - a.depth);
    for (const { flat, name, light } of drawn) {
      context.beginPath();
      flat.forEach(([x, y], index) => context[index ? 'lineTo' : 'moveTo'](x, y));
      context.closePath();
      context.fillStyle = mix(colour(name), light); context.strokeStyle = context.fillStyle; context.lineWidth = 0.7;
      context.fill(); context.stroke();
    }
  }

  drawCompass(context, project, heading) {
    const place = (angle, radius) => project([radius * Math.cos(angle), radius * Math.sin(angle), 0.75]);
    context.strokeStyle = colour('rule'); context.lineWidth = 1.2;
    for (const radius of [1.5, 2.0]) {
      context.beginPath();
      for (let angle = 0; angle <= 360; angle += 6) { const [x, y] = place(angle * rad, radius); context[angle ? 'lineTo' : 'moveTo'](x, y); }
      context.stroke();
    }
    context.textAlign = 'center'; context.textBaseline = 'middle'; context.font = '13px system-ui, sans-serif';
    for (let bearing = 0; bearing < 360; bearing += 30) {
      const angle = (bearing - heading) * rad;
      const [[x1, y1], [x2, y2]] = [place(angle, 1.9), place(angle, 2.0)];
      context.strokeStyle = colour('soft');
      context.beginPath(); context.moveTo(x1, y1); context.lineTo(x2, y2); context.stroke();
      const [x, y] = place(angle, 1.75);
      context.fillStyle = bearing === 0 ? colour('two') : colour('soft');
      context.fillText({ 0: 'N', 90: 'E', 180: 'S', 270: 'W' }[bearing] || String(bearing).padStart(3, '0'), x, y);
    }
  }
}

// Return the brightness 0.4 to 1 of the side of a face that the camera sees.
function shade(points, ahead) {
  const [a, b, c] = [points[0], points[1], points[points.length > 4 ? PARTS / 4 : 2]];
  const [u, v] = [[b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]];
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const size = (Math.hypot(...normal) || 1) * (dot(normal, ahead) > 0 ? -1 : 1);
  return 0.72 + 0.28 * dot(normal, LIGHT) / size;
}

function mix(hex, light) {
  const part = (from) => Math.round(parseInt(hex.slice(from, from + 2), 16) * light);
  return `rgb(${part(1)}, ${part(3)}, ${part(5)})`;
}
