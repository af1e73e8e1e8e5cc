/** CRC-32 as in IEEE 802.3 and zlib: the last four bytes of every message, little-endian, of all before them. */

export const kChecksumBytes = 4;
const kPolynomial = 0xedb88320; // its bits in reverse
const kSlices = 8; // bytes at a time, each through a table of its own

/** Slice s, byte b: what b does to the remainder when s more bytes follow it. */
function makeTables(): Int32Array {
  const tables = new Int32Array(256 * kSlices);
  for (let b = 0; b < 256; ++b) {
    let remainder = b;
    for (let bit = 0; bit < 8; ++bit) remainder = (remainder >>> 1) ^ ((remainder & 1) === 0 ? 0 : kPolynomial);
    tables[b] = remainder;
  }
  for (let i = 256; i < tables.length; ++i) {
    const before = tables[i - 256]!;
    tables[i] = (before >>> 8) ^ tables[before & 255]!;
  }
  return tables;
}

const kTables = makeTables();

export function crc32(bytes: Uint8Array): number {
  const t = kTables;
  const whole = bytes.length - (bytes.length % kSlices);
  let crc = -1;
  let i = 0;
  for (; i < whole; i += kSlices) {
    crc ^= bytes[i]! | (bytes[i + 1]! << 8) | (bytes[i + 2]! << 16) | (bytes[i + 3]! << 24);
    crc =
      t[0x700 + (crc & 255)]! ^ t[0x600 + ((crc >>> 8) & 255)]! ^
      t[0x500 + ((crc >>> 16) & 255)]! ^ t[0x400 + (crc >>> 24)]! ^
      t[0x300 + bytes[i + 4]!]! ^ t[0x200 + bytes[i + 5]!]! ^
      t[0x100 + bytes[i + 6]!]! ^ t[bytes[i + 7]!]!;
  }
  for (; i < bytes.length; ++i) crc = (crc >>> 8) ^ t[(crc ^ bytes[i]!) & 255]!;
  return ~crc >>> 0;
}

/** Writes into the last four bytes what the others give. */
export function writeChecksum(bytes: Uint8Array): void {
  const end = bytes.byteLength - kChecksumBytes;
  new DataView(bytes.buffer, bytes.byteOffset).setUint32(end, crc32(bytes.subarray(0, end)), true);
}

/** What is before the checksum; null where that does not fit. */
export function withoutChecksum(bytes: Uint8Array): Uint8Array | null {
  const end = bytes.byteLength - kChecksumBytes;
  if (end < 0) return null;
  const told = new DataView(bytes.buffer, bytes.byteOffset).getUint32(end, true);
  return told === crc32(bytes.subarray(0, end)) ? bytes.subarray(0, end) : null;
}
