// Copies a recording with the format's own npm packages: node copies.mjs IN.mcap OUT_FOLDER. Prints the name of each copy.
// The packages read lz4 and cannot write it, so there is no copy in lz4.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { McapIndexedReader, McapStreamReader, McapWriter } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import zstd from "@foxglove/wasm-zstd";

const [, , input, folder] = process.argv;
const bytes = readFileSync(input);
const decompressHandlers = await loadDecompressHandlers();
await zstd.isLoaded;

const inZstd = { compressChunk: (data) => ({ compression: "zstd", compressedData: new Uint8Array(zstd.compress(data, 3)) }) };
const changes = [
  { name: "sorted", records: sorted, options: inZstd },
  { name: "filtered", prefix: "/sightline/", options: inZstd },
  { name: "zstd", options: inZstd },
  { name: "none", options: {} },
  { name: "unchunked", options: { useChunks: false } },
  { name: "unindexed", options: { useStatistics: false, useSummaryOffsets: false, repeatSchemas: false, repeatChannels: false,
                                  useAttachmentIndex: false, useMetadataIndex: false, useMessageIndex: false, useChunkIndex: false } },
];

// Every record, in the file's order.
async function* inOrder() {
  const reader = new McapStreamReader({ decompressHandlers });
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) yield record;
}

// The schemas and channels, the messages in the order of their log times, and the rest.
async function* sorted() {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  yield* reader.schemasById.values();
  yield* reader.channelsById.values();
  yield* reader.readMessages({ validateCrcs: true });
  yield* reader.readAttachments();
  yield* reader.readMetadata();
}

class MemoryFile {
  parts = [];
  size = 0n;
  async write(part) {
    this.parts.push(part.slice());
    this.size += BigInt(part.length);
  }
  position() {
    return this.size;
  }
}

// Copies records, and gives each schema and channel the id that the writer chooses.
async function copy({ records = inOrder, prefix = "", options }) {
  const writable = new MemoryFile();
  const writer = new McapWriter({ writable, ...options });
  const schemas = new Map(), channels = new Map();
  const put = {
    Header: (header) => writer.start({ profile: header.profile, library: header.library }),
    Schema: async (schema) => schemas.has(schema.id) || schemas.set(schema.id, await writer.registerSchema(schema)),
    Channel: async (channel) => {
      if (channels.has(channel.id) || !channel.topic.startsWith(prefix)) return;
      channels.set(channel.id, await writer.registerChannel({ ...channel, schemaId: schemas.get(channel.schemaId) }));
    },
    Message: async (message) => {
      const channelId = channels.get(message.channelId);
      if (channelId !== undefined) await writer.addMessage({ ...message, channelId });
    },
    Attachment: (attachment) => writer.addAttachment(attachment),
    Metadata: (metadata) => writer.addMetadata(metadata),
  };
  if (records === sorted) await writer.start({ profile: "", library: "copies" });
  for await (const record of records()) await put[record.type]?.(record);
  await writer.end();
  return Buffer.concat(writable.parts);
}

for (const change of changes) {
  writeFileSync(join(folder, `${change.name}.mcap`), await copy(change));
  console.log(change.name);
}
