// The live page: receives events from this page's own server and draws them.

import { drawMap, drawStrip } from './charts.js';
import { HullView } from './hull.js';

const MAX_ROWS = 8000;
const MAX_OLD_ROWS = 3000;
const SILENT_MS = 5000;
const STRIPS = [
  { key: 'depth', title: 'depth, m', down: true, span: 1, digits: 2,
    series: [['depth_m', 'one', 'depth'], ['depth_setpoint_m', 'set', 'set-point']] },
  { key: 'heading', title: 'heading, deg', turns: true, span: 4, digits: 1,
    series: [['heading_deg', 'one', 'heading'], ['heading_setpoint_deg', 'set', 'set-point']] },
  { key: 'pitch', title: 'pitch and roll, deg', span: 4, digits: 1,
    series: [['pitch_deg', 'one', 'pitch'], ['pitch_setpoint_deg', 'set', 'set-point'], ['roll_deg', 'three', 'roll']] },
  { key: 'surfaces', title: 'duct, deg', other: 'outputs 1 and 2, %', span: 4, digits: 1,
    series: [['rudder', 'one', 'rudder', 'output 1'], ['elevator', 'two', 'elevator', 'output 2']] },
  { key: 'thrust', title: 'thrust, %', other: 'output 3, %', span: 10, digits: 0, series: [['thrust', 'one', 'thrust', 'output 3']] },
];
const EMPTY_PLAN = { waypoints: [], zones: [] };

const find = (id) => document.getElementById(id);
const made = (tag, text, kind) => {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (kind) element.className = kind;
  return element;
};

let [columns, rows, plan, panel, followed, ended, source, receivedMs] = [{}, [], EMPTY_PLAN, null, '', false, null, null];
const hull = new HullView(find('hull').querySelector('canvas'));
const map = find('map').querySelector('canvas');
const strips = STRIPS.map((strip) => {
  const figure = made('figure');
  const caption = made('figcaption');
  const title = caption.appendChild(made('span', strip.title));
  const values = strip.series.map(([column, name, label, other]) => {
    const value = caption.appendChild(made('span', undefined, 'value'));
    value.append(made('span', undefined, `key ${name}`), document.createTextNode(''));
    return { value, column, name, label, other };
  });
  const box = made('div', undefined, 'chart strip');
  box.id = strip.key;
  const canvas = box.appendChild(made('canvas'));
  canvas.setAttribute('role', 'img');
  canvas.setAttribute('aria-label', `${strip.title} over time`);
  figure.append(caption, box);
  find('strips').append(figure);
  return { ...strip, title, titleText: strip.title, values, canvas };
});

const last = () => (rows.length ? rows[rows.length - 1] : null);
// Return a number with that many digits, without the sign of a rounded zero.
function number(value, digits) {
  if (value === null || value === undefined) return '–';
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

// Show a heading set-point beside the heading: 359.9 deg and 0.1 deg are close to each other.
function near(value, reference) {
  return value === null || reference === null ? value : reference + ((value - reference + 540) % 360 + 360) % 360 - 180;
}

// Return at most MAX_OLD_ROWS rows at nearly even intervals of time.
function thinned(old) {
  const period = (old[old.length - 1][0] - old[0][0]) / (MAX_OLD_ROWS - 1);
  let due = -Infinity;
  return old.filter(([time]) => {
    if (time < due) return false;
    due = time + period;
    return true;
  });
}

function add(fresh) {
  const [heading, setpoint] = [columns.heading_deg, columns.heading_setpoint_deg];
  for (const row of fresh) {
    const before = last();
    if (before && row[0] < before[0] - 1) rows = [];
    const unwrapped = before && row[0] >= before[0] - 1 ? before[heading] : null;
    if (row[heading] !== null) row[heading] = unwrapped === null ? (row[heading] + 360) % 360 : near(row[heading], unwrapped);
    row[setpoint] = near(row[setpoint], row[heading]);
    rows.push(row);
  }
  if (rows.length > MAX_ROWS) {
    const half = rows.length >> 1;
    rows = [...thinned(rows.slice(0, half)), ...rows.slice(half)];
  }
}

function draw() {
  if (document.hidden) return;
  const row = last();
  const surfaces = !panel || panel.has_surfaces;
  const at = (column) => (row && row[columns[column]] !== null ? row[columns[column]] : 0);
  if (row) {
    hull.show({ heading: at('heading_deg'), pitch: at('pitch_deg'), roll: at('roll_deg'),
      rudder: surfaces ? at('rudder') : 0, elevator: surfaces ? at('elevator') : 0 });
    find('angles').textContent = `heading ${number(((Math.round(at('heading_deg')) % 360) + 360) % 360, 0).padStart(3, '0')}, pitch ${number(at('pitch_deg'), 1)}, roll ${number(at('roll_deg'), 1)} deg`;
    find('place').textContent = row[columns.north_m] === null ? 'no position' : `${number(at('north_m'), 0)} m north, ${number(at('east_m'), 0)} m east`;
  } else hull.draw();
  drawMap(map, rows, columns, plan, panel ? panel.sequence : null);
  const seconds = Number(find('window').value);
  for (const strip of strips) {
    strip.title.textContent = surfaces ? strip.titleText : strip.other || strip.titleText;
    for (const { value, column, label, other } of strip.values) {
      let shown = row ? row[columns[column]] : null;
      if (shown !== null && shown !== undefined && column.startsWith('heading')) shown = ((shown % 360) + 360) % 360;
      value.lastChild.textContent = `${surfaces ? label : other || label} ${number(shown, strip.digits)}`;
      value.hidden = label === 'set-point' && (shown === null || shown === undefined);
    }
    const series = strip.series.map(([column, name]) => ({ column: columns[column], colour: name, dashed: name === 'set' }));
    drawStrip(strip.canvas, rows, series, seconds, strip);
  }
}

function list(id, entries) {
  find(id).replaceChildren(...entries.flatMap(({ label, text, alarm, age }) => {
    const value = made('dd', text, alarm ? 'alarm' : age ? 'old' : '');
    if (age) value.append(made('span', age, 'age'));
    return [made('dt', label), value];
  }));
}

function showPanel() {
  const cell = (label) => panel.rows.find((entry) => entry.label === label);
  find('name').textContent = panel.name;
  document.title = `${panel.name} – Caribou live`;
  for (const label of ['mode', 'armed']) {
    const entry = cell(label);
    find(label).textContent = entry ? entry.text : '–';
  }
  const { link } = panel;
  find('link').textContent = link.state === 'live' ? 'link good' : link.text;
  find('link').className = `chip ${{ live: 'good', silent: 'bad' }[link.state] || ''}`;
  for (const section of ['vehicle', 'motion', 'mission']) list(section, panel.rows.filter((entry) => entry.section === section));
  list('counts', [
    { label: 'state', text: link.text, alarm: link.state === 'silent' },
    { label: 'rate', text: `${link.messages_per_s} messages/s, ${link.kb_per_s.toFixed(1)} kB/s` },
    { label: 'lost', text: `${link.lost} messages` },
    { label: 'rejected', text: `${link.rejected} messages` },
  ]);
  find('texts').replaceChildren(...(panel.texts.length ? panel.texts.map(({ text, level, age }) => {
    const entry = made('li', text, level);
    entry.append(made('span', age, 'age'));
    return entry;
  }) : [made('li', 'no texts yet', 'quiet')]));
  showEstimate(panel.estimate);
}

function showEstimate(estimate) {
  find('estimate').hidden = !estimate;
  if (!estimate) return;
  const planes = estimate.planes.map(({ plane, testing, enough, verdict, rows: numbers }) => {
    const box = made('div');
    box.append(made('strong', `${plane}${testing ? ', under test' : ''}`));
    box.append(made('div', `${enough ? 'Enough' : 'Continue'}: ${verdict}`, `verdict ${enough ? 'enough' : 'more'}`));
    const values = box.appendChild(made('dl'));
    for (const [label, text] of numbers) values.append(made('dt', label), made('dd', text));
    return box;
  });
  if (estimate.trouble) planes.push(made('p', estimate.trouble, 'no'));
  if (!planes.length) planes.push(made('p', 'no test yet', 'quiet'));
  find('planes').replaceChildren(...planes);
}

function showDives(names) {
  find('dives').hidden = names.length < 2;
  find('dive').replaceChildren(made('option', 'newest'), ...names.map((name) => made('option', name)));
  find('dive').options[0].value = '';
  find('dive').value = followed;
}

function receive(event) {
  receivedMs = performance.now();
  const news = JSON.parse(event.data);
  if (news.columns) {
    columns = Object.fromEntries(news.columns.map((name, index) => [name, index]));
    [rows, plan, panel] = [[], EMPTY_PLAN, null];
  }
  if (news.dives) showDives(news.dives);
  if (news.plan) plan = news.plan;
  if (news.panel) { panel = news.panel; showPanel(); }
  if (news.rows) add(news.rows);
  banner('');
  draw();
}

function banner(text, calm) {
  find('banner').hidden = !text;
  find('banner').textContent = text;
  find('banner').className = calm ? 'calm' : '';
}

function connect() {
  if (source) source.close();
  source = new EventSource(`events?dive=${encodeURIComponent(followed)}`);
  source.onopen = () => { find('link').textContent = 'waiting for telemetry'; };
  source.onmessage = receive;
  source.addEventListener('end', () => {
    ended = true;
    source.close();
    banner('ground has ended; the page shows its last state', true);
  });
  source.onerror = () => { if (!ended) showLoss('no connection to ground; trying again'); };
}

function showLoss(text) {
  banner(text);
  find('link').textContent = 'link unknown';
  find('link').className = 'chip bad';
}

// Show that nothing arrives on an open connection: ground sends twice a second unless it hangs or its network fails.
function checkSilence() {
  const silentMs = performance.now() - receivedMs;
  if (receivedMs === null || ended || silentMs < SILENT_MS || source.readyState !== EventSource.OPEN) return;
  showLoss(`nothing received from ground for ${Math.round(silentMs / 1000)} s; the page shows an old state`);
}

find('dive').addEventListener('change', (event) => { followed = event.target.value; connect(); });
find('window').addEventListener('change', draw);
document.addEventListener('visibilitychange', draw);
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
for (const [name, printed] of [['beforeprint', true], ['afterprint', false]]) {
  window.addEventListener(name, () => { document.documentElement.classList.toggle('printed', printed); draw(); });
}
const resized = new ResizeObserver(() => draw());
document.querySelectorAll('.chart').forEach((chart) => resized.observe(chart));
connect();
setInterval(checkSilence, 1000);
