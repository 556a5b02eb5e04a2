// Check the use of the vehicle by node-mavlink; print one JSON object.
//
// Usage: node checks.js udp:PORT|tcp:PORT|DEVICE. The vehicle listens on the UDP or TCP port of
// 127.0.0.1, or is at the other end of a serial line of 57600 baud.
const assert = require("assert/strict");
const { EventEmitter } = require("events");
const {
  MavEsp8266,
  MavTCP,
  MavLinkPacketSplitter,
  MavLinkPacketParser,
  ardupilotmega,
  common,
  development,
  minimal,
  send,
  sleep,
  standard,
} = require("node-mavlink");

const REGISTRY = {
  ...development.REGISTRY,
  ...minimal.REGISTRY,
  ...standard.REGISTRY,
  ...common.REGISTRY,
  ...ardupilotmega.REGISTRY,
};
const SYSTEM = 250;
const COMPONENT = 190;
const ATTEMPTS = 10; // of a request: the line may lose it or its answer
const RETRY_MS = 1500;
const PATIENCE_MS = 60_000;
const LAST_ITEM_MS = 5000; // the vehicle asks again after 1.5 s
const ACCEPTED = 0;
const DENIED = 2;
const UNSUPPORTED = 3;
const HOLD = 50593792;
const MISSION = 67371008;
const STATION = 196608;
const MODES = { MANUAL: 65536, DEPTH: 131072, STATION, HOLD, SURFACE: 100925440, STABILIZE: 458752 };
const STREAMS = [
  "ATTITUDE",
  "ATTITUDE_QUATERNION",
  "BATTERY_STATUS",
  "CURRENT_MODE",
  "EXTENDED_SYS_STATE",
  "GLOBAL_POSITION_INT",
  "GPS_RAW_INT",
  "LOCAL_POSITION_NED",
  "MISSION_CURRENT",
  "SYS_STATUS",
  "VFR_HUD",
];

// One connection: packets of the autopilot, decoded by node-mavlink, as events.
class Vehicle extends EventEmitter {
  constructor() {
    super();
    this.setMaxListeners(100);
    this.latest = {};
    this.counts = {};
    this.texts = [];
    this.beats = [];
  }

  async connect(where) {
    const [kind, port] = where.split(":");
    if (kind === "udp") {
      this.port = new MavEsp8266();
      await this.port.start(0, Number(port), "127.0.0.1");
    } else if (kind === "tcp") {
      this.port = new MavTCP();
      await this.port.start("127.0.0.1", Number(port));
    } else {
      const { SerialPort } = require("serialport");
      this.serial = new SerialPort({ path: where, baudRate: 57600 });
      this.port = this.serial.pipe(new MavLinkPacketSplitter()).pipe(new MavLinkPacketParser());
    }
    this.port.on("data", (packet) => this.receive(packet));
    this.beating = setInterval(() => this.beat(), 1000);
    await this.beat();
  }

  async beat() {
    const beat = Object.assign(new minimal.Heartbeat(), {
      type: minimal.MavType.GCS,
      autopilot: minimal.MavAutopilot.INVALID,
      baseMode: 0,
      customMode: 0,
      systemStatus: minimal.MavState.ACTIVE,
      mavlinkVersion: 3,
    });
    await this.send(beat);
  }

  receive(packet) {
    const { msgid, sysid, compid } = packet.header;
    if (compid !== 1 || REGISTRY[msgid] === undefined) return;
    const data = packet.protocol.data(packet.payload, REGISTRY[msgid]);
    const name = REGISTRY[msgid].MSG_NAME;
    this.system = sysid;
    this.latest[name] = data;
    this.counts[name] = (this.counts[name] ?? 0) + 1;
    if (name === "STATUSTEXT") this.texts.push(data.text);
    if (name === "HEARTBEAT") this.beats.push(Date.now());
    this.emit(name, data);
  }

  async send(message) {
    if (this.serial !== undefined) {
      const { MavLinkProtocolV2 } = require("node-mavlink");
      await send(this.serial, message, new MavLinkProtocolV2(SYSTEM, COMPONENT));
    } else {
      await this.port.send(message, SYSTEM, COMPONENT);
    }
  }

  // The next message of a name that meets a condition; undefined after a time.
  next(name, wanted = () => true, within_ms = RETRY_MS) {
    return new Promise((resolve) => {
      const listener = (data) => wanted(data) && finish(data);
      const timer = setTimeout(() => finish(undefined), within_ms);
      const finish = (data) => {
        clearTimeout(timer);
        this.off(name, listener);
        resolve(data);
      };
      this.on(name, listener);
    });
  }

  // Send a message until one of the answers arrives.
  async ask(message, name, wanted = () => true) {
    for (let attempt = 0; attempt < ATTEMPTS; attempt++) {
      const answer = this.next(name, wanted);
      await this.send(message);
      const data = await answer;
      if (data !== undefined) return data;
    }
    throw new Error(`no ${name} after ${ATTEMPTS} requests`);
  }

  async command(number, ...parameters) {
    const fields = Object.fromEntries(parameters.map((value, n) => [`_param${n + 1}`, value]));
    const message = Object.assign(new common.CommandLong(number), fields, {
      command: number,
      targetSystem: 1,
      targetComponent: 1,
      confirmation: 0,
    });
    return (await this.ask(message, "COMMAND_ACK", (ack) => ack.command === number)).result;
  }

  // Request a message until it arrives.
  async request(name, parameter = 0, wanted = () => true) {
    const id = Number(Object.keys(REGISTRY).find((key) => REGISTRY[key].MSG_NAME === name));
    for (let attempt = 0; attempt < ATTEMPTS; attempt++) {
      const answer = this.next(name, wanted);
      assert.equal(await this.command(512, id, parameter), ACCEPTED, "result of REQUEST_MESSAGE");
      const data = await answer;
      if (data !== undefined) return data;
    }
    throw new Error(`no ${name}`);
  }

  async until(condition, what) {
    const end_ms = Date.now() + PATIENCE_MS;
    while (!condition()) {
      assert.ok(Date.now() < end_ms, what);
      await sleep(20);
    }
  }

  setMode(number) {
    return this.command(176, 1, number);
  }

  async becomes(number) {
    await this.until(
      () => this.latest.HEARTBEAT?.customMode === number,
      `mode is ${this.latest.HEARTBEAT?.customMode}, not ${number}`,
    );
  }

  isArmed() {
    return (this.latest.HEARTBEAT.baseMode & 128) !== 0;
  }
}

function target(message, fields) {
  return Object.assign(message, { targetSystem: 1, targetComponent: 1 }, fields);
}

// Items [frame, command, p1, p2, p3, p4, x, y, z] of a plan.
const LEG = [
  [2, 178, 1, -1, 58, 0, 0, 0, 0],
  [2, 186, -4, 3, 0, 0, 0, 0, 0],
  [2, 115, 40, 0, 0, 0, 0, 0, 0],
  [2, 93, 10000, -1, -1, -1, 0, 0, 0],
];
const FENCE = [
  [0, 5001, 3, 0, 0, 0, 430000000, -710000000, 0],
  [0, 5001, 3, 0, 0, 0, 420000000, -720000000, 0],
  [0, 5001, 3, 0, 0, 0, 420000000, -700000000, 0],
];

// Upload a plan; return MISSION_ACK.type.
async function upload(v, rows, missionType = 0) {
  const items = rows.map(([frame, command, param1, param2, param3, param4, x, y, z], seq) =>
    target(new common.MissionItemInt(), {
      ...{ frame, command, param1, param2, param3, param4, x, y, z, seq, missionType },
      current: seq === 0 ? 1 : 0,
      autocontinue: 1,
    }),
  );
  let timer; // sends the last item again: its acknowledgement may be lost
  const answer = (request) => {
    if (request.missionType !== missionType || !items[request.seq]) return;
    clearInterval(timer);
    timer = setInterval(() => v.send(items[request.seq]), LAST_ITEM_MS);
    v.send(items[request.seq]);
  };
  v.on("MISSION_REQUEST_INT", answer);
  try {
    const over = v.next("MISSION_ACK", (ack) => ack.missionType === missionType, PATIENCE_MS);
    const count = target(new common.MissionCount(), { count: items.length, missionType, opaqueId: 0 });
    await v.send(count);
    let begun = false;
    v.once("MISSION_REQUEST_INT", () => (begun = true));
    for (let attempt = 0; attempt < ATTEMPTS && !begun; attempt++) {
      await sleep(RETRY_MS);
      if (!begun) await v.send(count);
    }
    const ack = await over;
    assert.ok(ack !== undefined, "no MISSION_ACK");
    return ack.type;
  } finally {
    clearInterval(timer);
    v.off("MISSION_REQUEST_INT", answer);
  }
}

async function download(v, missionType = 0) {
  const list = target(new common.MissionRequestList(), { missionType });
  const { count } = await v.ask(list, "MISSION_COUNT", (m) => m.missionType === missionType);
  const rows = [];
  for (let seq = 0; seq < count; seq++) {
    const request = target(new common.MissionRequestInt(), { seq, missionType });
    const m = await v.ask(request, "MISSION_ITEM_INT", (item) => item.seq === seq);
    rows.push([m.frame, m.command, m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z]);
  }
  await v.send(target(new common.MissionAck(), { type: 0, missionType, opaqueId: 0 }));
  return rows;
}

// One request of MAVLink FTP: number of the operation, data, session and offset.
async function ftp(v, opcode, { data = "", session = 0, offset = 0, size = data.length } = {}) {
  ftp.sequence = ((ftp.sequence ?? 0) + 1) & 0xffff;
  const payload = Buffer.alloc(251);
  payload.writeUInt16LE(ftp.sequence, 0);
  payload.set([session, opcode, size, 0, 0], 2);
  payload.writeUInt32LE(offset, 8);
  payload.write(data, 12, "ascii");
  const message = Object.assign(new common.FileTransferProtocol(), {
    ...{ targetNetwork: 0, targetSystem: 1, targetComponent: 1, payload: [...payload] },
  });
  const wanted = (m) => m.payload[5] === opcode && (m.payload[0] | (m.payload[1] << 8)) > ftp.sequence;
  const answer = Buffer.from((await v.ask(message, "FILE_TRANSFER_PROTOCOL", wanted)).payload);
  ftp.sequence = answer.readUInt16LE(0);
  return { isAck: answer[3] === 128, session: answer[2], data: answer.subarray(12, 12 + answer[4]) };
}

async function finds_the_vehicle(v) {
  await v.until(() => v.latest.HEARTBEAT?.systemStatus >= 3, "no heartbeat in standby");
  const { type, autopilot, baseMode } = v.latest.HEARTBEAT;
  assert.deepEqual([v.system, type, autopilot], [1, minimal.MavType.SUBMARINE, 0]);
  assert.ok(baseMode & minimal.MavModeFlag.CUSTOM_MODE_ENABLED);
}

async function reads_the_version(v) {
  const { capabilities, flightSwVersion } = await v.request("AUTOPILOT_VERSION");
  assert.equal(flightSwVersion >>> 16, 1, "version 0.1");
  for (const bit of [4n, 8n, 16n, 32n, 8192n]) assert.ok(capabilities & bit, `capability ${bit}`);
}

async function reads_available_modes(v) {
  const { numberModes } = await v.request("AVAILABLE_MODES", 1, (m) => m.modeIndex === 1);
  const numbers = new Set();
  for (let index = 1; index <= numberModes; index++) {
    numbers.add((await v.request("AVAILABLE_MODES", index, (m) => m.modeIndex === index)).customMode);
  }
  for (const number of Object.values(MODES)) assert.ok(numbers.has(number), `${number} is missing`);
}

async function lists_parameters(v) {
  const values = new Map();
  const take = (m) => values.set(m.paramIndex, m);
  v.on("PARAM_VALUE", take);
  const all = target(new common.ParamRequestList(), {});
  const { paramCount } = await v.ask(all, "PARAM_VALUE");
  for (let seen = -1; values.size < paramCount && seen !== values.size; ) {
    seen = values.size;
    await sleep(RETRY_MS);
  }
  for (let index = 0; index < paramCount; index++) {
    const request = target(new common.ParamRequestRead(), { paramIndex: index, paramId: "" });
    if (!values.has(index)) await v.ask(request, "PARAM_VALUE", (m) => m.paramIndex === index);
  }
  v.off("PARAM_VALUE", take);
  const names = new Set([...values.values()].map((m) => m.paramId));
  assert.equal(names.size, paramCount);
  assert.ok(names.has("HDG_P"));
}

function readParameter(v, paramId) {
  const request = target(new common.ParamRequestRead(), { paramIndex: -1, paramId });
  return v.ask(request, "PARAM_VALUE", (m) => m.paramId === paramId);
}

async function reads_a_parameter(v) {
  const { paramType, paramValue } = await readParameter(v, "STN_RADIUS_M");
  assert.deepEqual([paramType, paramValue], [common.MavParamType.REAL32, 20]);
}

async function sets_a_parameter(v) {
  for (const paramValue of [25, 20]) {
    const message = target(new common.ParamSet(), {
      ...{ paramId: "STN_RADIUS_M", paramValue, paramType: common.MavParamType.REAL32 },
    });
    const isIt = (m) => m.paramId === "STN_RADIUS_M" && m.paramValue === paramValue;
    await v.ask(message, "PARAM_VALUE", isIt);
    assert.equal((await readParameter(v, "STN_RADIUS_M")).paramValue, paramValue);
  }
}

async function sets_an_integer_parameter(v) {
  // capability PARAM_ENCODE_BYTEWISE: the bytes of the float are those of the integer
  const paramValue = new DataView(new Uint32Array([30]).buffer).getFloat32(0, true);
  const message = target(new common.ParamSet(), {
    ...{ paramId: "STN_RADIUS_M", paramValue, paramType: common.MavParamType.INT32 },
  });
  const isIt = (m) => m.paramId === "STN_RADIUS_M" && m.paramValue === 30;
  await v.ask(message, "PARAM_VALUE", isIt);
}

async function home_is_at_the_surface(v) {
  const { altitude, latitude } = await v.request("HOME_POSITION");
  assert.equal(altitude, 0);
  assert.ok(latitude !== 0);
}

async function mission_round_trip(v) {
  assert.equal(await upload(v, LEG), ACCEPTED, "MISSION_ACK");
  assert.deepEqual(await download(v), LEG);
}

async function altitude_above_water_is_refused(v) {
  const high = [[3, 16, 0, 0, 0, 0, 0, 0, 5]];
  assert.equal(await upload(v, high), common.MavMissionResult.INVALID_PARAM7, "MISSION_ACK");
  assert.deepEqual(await download(v), LEG, "the mission of before");
}

async function unsupported_command_is_refused(v) {
  const takeoff = [[3, 22, 0, 0, 0, 0, 0, 0, 0]];
  assert.equal(await upload(v, takeoff), common.MavMissionResult.UNSUPPORTED, "MISSION_ACK");
}

async function geofence_round_trip(v) {
  assert.equal(await upload(v, FENCE, 1), ACCEPTED, "MISSION_ACK");
  assert.deepEqual(await download(v, 1), FENCE);
  const clear = target(new common.MissionClearAll(), { missionType: 1 });
  await v.ask(clear, "MISSION_ACK", (m) => m.missionType === 1 && m.type === 0);
}

async function sets_every_mode(v) {
  for (const number of Object.values(MODES)) {
    assert.equal(await v.setMode(number), ACCEPTED, `result of ${number}`);
    await v.becomes(number);
  }
}

async function unknown_mode_is_refused(v) {
  assert.ok([DENIED, UNSUPPORTED].includes(await v.setMode(9)));
}

async function takeoff_is_refused_with_reason(v) {
  for (let attempt = 0; attempt < ATTEMPTS; attempt++) {
    assert.equal(await v.command(22), UNSUPPORTED);
    await sleep(300);
    if (v.texts.some((text) => /takeoff/i.test(text))) return;
  }
  assert.fail(`texts are ${v.texts}`);
}

async function arms_and_disarms(v) {
  assert.equal(await v.setMode(HOLD), ACCEPTED);
  assert.equal(await v.command(400, 1), ACCEPTED, "arm");
  await v.until(() => v.isArmed(), "HEARTBEAT is not armed");
  assert.equal(await v.command(400, 0), ACCEPTED, "disarm");
  await v.until(() => !v.isArmed(), "HEARTBEAT is armed");
}

async function starts_the_mission(v) {
  assert.equal(await v.command(400, 1), ACCEPTED, "arm");
  assert.equal(await v.command(300, 0, 0), ACCEPTED, "MISSION_START");
  await v.becomes(MISSION);
}

async function dives(v) {
  const deep = () => v.latest.GLOBAL_POSITION_INT?.relativeAlt < -1500;
  await v.until(deep, "is never 1.5 m down");
  await v.until(() => v.latest.LOCAL_POSITION_NED?.z > 1, "z is not down");
  await v.until(() => v.latest.VFR_HUD?.alt < -1, "alt is not up");
}

async function reports_progress(v) {
  await v.until(() => v.latest.MISSION_CURRENT?.seq === 3, "item 3 was never current");
  assert.equal(v.latest.MISSION_CURRENT.total, 4);
}

async function receives_every_stream(v) {
  const missing = () => STREAMS.filter((name) => !v.counts[name]);
  await v.until(() => missing().length === 0, `never received ${missing()}`);
}

async function sets_a_rate(v) {
  assert.equal(await v.command(511, 30, 500_000), ACCEPTED);
  const { intervalUs } = await v.request("MESSAGE_INTERVAL", 30);
  assert.equal(intervalUs, 500_000);
  v.counts.ATTITUDE = 0;
  await sleep(6000);
  assert.ok(v.counts.ATTITUDE >= 6 && v.counts.ATTITUDE <= 14, `${v.counts.ATTITUDE} in 6 s`);
  assert.equal(await v.command(511, 30, 0), ACCEPTED);
}

async function goes_to_a_place(v) {
  const { lat, lon } = v.latest.GLOBAL_POSITION_INT;
  const message = target(new common.CommandInt(192), {
    ...{ command: 192, frame: 6, current: 0, autocontinue: 0 },
    ...{ _param1: -1, _param2: 1, _param3: 0, _param4: NaN },
    ...{ _param5: lat + 5000, _param6: lon, _param7: -3 },
  });
  const { result } = await v.ask(message, "COMMAND_ACK", (ack) => ack.command === 192);
  assert.equal(result, ACCEPTED);
  await v.becomes(STATION);
}

async function synchronises_time(v) {
  const message = target(new common.TimeSync(), { tc1: 0n, ts1: 4711n });
  const { tc1 } = await v.ask(message, "TIMESYNC", (m) => m.ts1 === 4711n && m.tc1 !== 0n);
  assert.ok(tc1 > 0n);
}

async function answers_a_ping(v) {
  const ping = Object.assign(new common.Ping(), {
    ...{ timeUsec: 1n, seq: 7, targetSystem: 0, targetComponent: 0 },
  });
  const answer = await v.ask(ping, "PING", (m) => m.seq === 7);
  assert.deepEqual([answer.targetSystem, answer.targetComponent], [SYSTEM, COMPONENT]);
}

async function disarms_by_force(v) {
  assert.equal(await v.command(400, 0, 21196), ACCEPTED);
  await v.until(() => !v.isArmed(), "HEARTBEAT is armed");
}

async function lists_logs(v) {
  const list = target(new common.LogRequestList(), { start: 0, end: 0xffff });
  const { numLogs, size } = await v.ask(list, "LOG_ENTRY", (m) => m.size > 0);
  assert.ok(numLogs >= 1 && size > 0);
}

async function lists_files(v) {
  const { isAck, data } = await ftp(v, 3, { data: "/" });
  assert.ok(isAck && data.toString().includes("Dparams"), data.toString());
}

async function downloads_a_file(v) {
  const { isAck, session, data } = await ftp(v, 4, { data: "/params/current.param" });
  assert.ok(isAck, "OpenFileRO");
  const size = data.readUInt32LE(0);
  let content = Buffer.alloc(0);
  while (content.length < size) {
    const part = await ftp(v, 5, { session, offset: content.length, size: 239 });
    assert.ok(part.isAck && part.data.length > 0, "ReadFile");
    content = Buffer.concat([content, part.data]);
  }
  assert.ok((await ftp(v, 1, { session })).isAck, "TerminateSession");
  assert.match(content.toString(), /HDG_P/);
}

async function clears_the_mission(v) {
  const clear = target(new common.MissionClearAll(), { missionType: 0 });
  assert.equal((await v.ask(clear, "MISSION_ACK")).type, ACCEPTED);
  assert.deepEqual(await download(v), []);
}

async function receives_heartbeat_every_second(v) {
  const seconds = (v.beats.at(-1) - v.beats[0]) / 1000;
  const rate = (v.beats.length - 1) / seconds;
  assert.ok(rate > (v.serial === undefined ? 0.9 : 0.7), `${rate} Hz`);
}

const EVERY = [
  finds_the_vehicle,
  reads_the_version,
  reads_available_modes,
  lists_parameters,
  reads_a_parameter,
  sets_a_parameter,
  sets_an_integer_parameter,
  home_is_at_the_surface,
  mission_round_trip,
  altitude_above_water_is_refused,
  unsupported_command_is_refused,
  geofence_round_trip,
  sets_every_mode,
  unknown_mode_is_refused,
  takeoff_is_refused_with_reason,
  arms_and_disarms,
  starts_the_mission,
  dives,
  reports_progress,
  receives_every_stream,
  sets_a_rate,
  goes_to_a_place,
  synchronises_time,
  answers_a_ping,
  disarms_by_force,
  lists_logs,
  lists_files,
  downloads_a_file,
  clears_the_mission,
  receives_heartbeat_every_second,
];

async function main(where) {
  const vehicle = new Vehicle();
  await vehicle.connect(where);
  const verdicts = {};
  for (const check of EVERY) {
    const began_ms = Date.now();
    let why = "";
    try {
      await check(vehicle);
    } catch (error) {
      why = `${error.name}: ${error.message}`;
    }
    const s = (Date.now() - began_ms) / 1000;
    verdicts[check.name.replaceAll("_", " ")] = { pass: why === "", why, s };
  }
  console.log(JSON.stringify(verdicts));
  process.exit(0);
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exit(1);
});
