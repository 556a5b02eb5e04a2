// Decode every message of an MCAP log with Foxglove's packages and print counts as JSON.
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg-serialization");
const official = require("@foxglove/schemas/jsonschema");
const fzstd = require("fzstd");

class FileReadable {
  constructor(path) {
    this.data = fs.readFileSync(path);
  }
  async size() {
    return BigInt(this.data.length);
  }
  async read(offset, length) {
    return new Uint8Array(this.data.subarray(Number(offset), Number(offset + length)));
  }
}

// The kind of every property of a JSON message must be that of its schema.
function check(schema, value, where) {
  if (schema.type === "object") {
    for (const [name, item] of Object.entries(value)) {
      const known = (schema.properties ?? {})[name];
      if (known == undefined) throw new Error(`${where}.${name} is not in the schema`);
      check(known, item, `${where}.${name}`);
    }
  } else if (schema.type === "array") {
    if (!Array.isArray(value)) throw new Error(`${where} is no array`);
    for (const item of value) check(schema.items ?? {}, item, `${where}[]`);
  } else if (schema.type === "integer") {
    if (!Number.isInteger(value)) throw new Error(`${where} = ${value} is no integer`);
  } else if (schema.type != undefined && typeof value !== schema.type) {
    throw new Error(`${where} = ${value} is no ${schema.type}`);
  }
}

async function count(path) {
  const reader = await McapIndexedReader.Initialize({
    readable: new FileReadable(path),
    decompressHandlers: {
      zstd: (buffer, size) => fzstd.decompress(buffer, new Uint8Array(Number(size))),
    },
  });
  const decoders = new Map();
  const decoded = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    let decode = decoders.get(channel.id);
    if (decode == undefined) {
      const text = new TextDecoder().decode(schema.data);
      if (channel.messageEncoding === "ros1" && schema.encoding === "ros1msg") {
        const ros = new MessageReader(parse(text, { ros2: false }));
        decode = (data) => ros.readMessage(data);
      } else if (channel.messageEncoding === "json" && schema.encoding === "jsonschema") {
        const json = JSON.parse(text);
        const published = official[schema.name.replace("foxglove.", "")];
        if (published == undefined) throw new Error(`${schema.name} is no schema of Foxglove`);
        decode = (data) => {
          const value = JSON.parse(new TextDecoder().decode(data));
          check(json, value, channel.topic);
          check(published, value, channel.topic);
        };
      } else {
        throw new Error(`${channel.topic}: unknown encoding ${channel.messageEncoding}`);
      }
      decoders.set(channel.id, decode);
    }
    decode(message.data);
    decoded[channel.topic] = (decoded[channel.topic] ?? 0) + 1;
  }
  return {
    profile: reader.header.profile,
    messages: Number(reader.statistics.messageCount),
    decoded,
  };
}

(async () => {
  const results = {};
  for (const path of process.argv.slice(2)) results[path] = await count(path);
  console.log(JSON.stringify(results));
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
