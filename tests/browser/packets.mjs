// Packets as a node writes them (schema/packet.fbs), small: one coloured chunk, no pictures.
import { crc32 } from "node:zlib";
import { readFileSync } from "node:fs";

const kPayload = readFileSync(new URL("../../web/tests/data/chunk_background.drc", import.meta.url));
export const kLattice = { low_corner: [-512, -512, -512], step: 2 ** -10 };
const kKey = [0, 0, 0, 0xfffffffe, 0, 0, 1]; // of a chunk that has colours

/** Fields of a table that lie in it: their size, and how they are written. */
const u8 = (value) => [1, (view, at) => view.setUint8(at, value)];
const u32 = (value) => [4, (view, at) => view.setUint32(at, value, true)];
const u64 = (value) => [8, (view, at) => view.setBigUint64(at, BigInt(value), true)];
const f64 = (value) => [8, (view, at) => view.setFloat64(at, value, true)];
const key = () => [28, (view, at) => kKey.forEach((word, i) => view.setUint32(at + 4 * i, word, true))];
const pose = () => [96, (view, at) => [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0].forEach((v, i) => view.setFloat64(at + 8 * i, v, true))];
/** And those that lie behind it: who writes them and says where. */
const table = (fields) => (writer) => writer.table(fields);
const text = (string) => (writer) => writer.vector(1, [...string, "\0"].map((c) => u8(c.charCodeAt(0))), string.length);
const vector = (size, items) => (writer) => writer.vector(size, items);
const tables = (list) => (writer) => writer.tables(list);

/** Parents first, so that every offset points ahead. */
class Writer {
  view = new DataView(new ArrayBuffer(1 << 16));
  end = 8; // where the root lies, and the identifier

  take(bytes, align) {
    const at = Math.ceil(this.end / align) * align;
    this.end = at + bytes;
    return at;
  }

  put(at, field) {
    if (Array.isArray(field)) field[1](this.view, at);
    else this.view.setUint32(at, field(this) - at, true);
  }

  table(fields) {
    const used = Object.keys(fields).map(Number);
    const vtable = this.take(4 + 2 * (Math.max(...used) + 1), 2);
    let size = 4;
    const places = used.map((index) => {
      const bytes = Array.isArray(fields[index]) ? fields[index][0] : 4;
      const align = Math.min(8, bytes & -bytes);
      const place = Math.ceil(size / align) * align;
      size = place + bytes;
      return place;
    });
    this.view.setUint16(vtable, 4 + 2 * (Math.max(...used) + 1), true);
    this.view.setUint16(vtable + 2, size, true);
    const at = this.take(size, 8);
    this.view.setInt32(at, at - vtable, true);
    used.forEach((index, i) => this.view.setUint16(vtable + 4 + 2 * index, places[i], true));
    used.forEach((index, i) => this.put(at + places[i], fields[index]));
    return at;
  }

  vector(size, items, count = items.length) {
    const at = this.take(4 + size * items.length, 8);
    this.view.setUint32(at, count, true);
    items.forEach((item, i) => this.put(at + 4 + size * i, item));
    return at;
  }

  tables(list) {
    return this.vector(4, list.map(table));
  }
}

const camera = () => table({ 1: u32(64), 2: u32(48), 3: f64(50), 4: f64(50), 5: f64(31.5), 6: f64(23.5) });
const nsOf = (ms) => BigInt(Math.round(ms * 1000)) * 1000n;

/** A packet that brings its base. Times are ms since 1970; `sources`: of each sensor when it captured. */
export function packetOf({ epoch = 1, sequence, capturedAtMs, sources }) {
  const writer = new Writer();
  const head = {
    0: text("fake"),
    1: text("root"),
    2: table({ 3: u32(28) }),
    3: tables(sources.map(({ sensor }) => ({ 0: u32(sensor), 1: camera(), 2: pose() }))),
    5: vector(28, [key()]),
  };
  const chunk = { 0: key(), 2: u32(2), 4: vector(1, [...kPayload].map(u8)) };
  const root = writer.table({
    0: u32(epoch), 1: u64(sequence), 2: u64(nsOf(capturedAtMs)), 7: tables([chunk]), 9: table(head),
    11: vector(8, sources.map((source) => u64(nsOf(source.capturedAtMs)))),
  });
  writer.view.setUint32(0, root, true);
  const bytes = Buffer.alloc(writer.end + 4);
  bytes.set(new Uint8Array(writer.view.buffer, 0, writer.end));
  bytes.write("MRP4", 4);
  bytes.writeUInt32LE(crc32(bytes.subarray(0, writer.end)), writer.end);
  return bytes;
}
