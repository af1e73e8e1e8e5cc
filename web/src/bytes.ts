/** Bytes that do not hold what they should. The only error that reading bytes throws. */
export class Malformed extends Error {}

export function require(condition: boolean, what: string): asserts condition {
  if (!condition) throw new Malformed(what);
}

const kMaxTables = 1 << 18;

/** Reads one FlatBuffer that may come from anyone: no byte outside it is ever touched, at any alignment,
 *  and what is read out of it is no larger than the buffer, however its offsets overlap. */
export class FlatBuffer {
  readonly view: DataView;
  private unread: number;
  private tables = kMaxTables;

  constructor(readonly bytes: Uint8Array) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.unread = bytes.byteLength;
  }

  /** Four characters that name the format. */
  identifier(): string {
    this.inside(4, 4);
    return String.fromCharCode(...this.bytes.subarray(4, 8));
  }

  root(): Table {
    this.inside(0, 8);
    return this.tableAt(this.view.getUint32(0, true));
  }

  tableAt(at: number): Table {
    require(--this.tables >= 0, "too many tables");
    return new Table(this, at);
  }

  inside(at: number, size: number): void {
    require(at >= 0 && at + size <= this.bytes.byteLength, "cut off or damaged");
  }

  spend(bytes: number): void {
    this.unread -= bytes;
    require(this.unread >= 0, "fields overlap");
  }

  /** Where the thing lies that the 32-bit offset at `at` points to. */
  follow(at: number): number {
    this.inside(at, 4);
    const to = at + this.view.getUint32(at, true);
    require(to > at, "an offset of zero");
    this.inside(to, 4);
    return to;
  }
}

/** Where `count` elements of one size lie. */
export interface Span {
  readonly at: number;
  readonly count: number;
}

const kNothing: Span = { at: 0, count: 0 };

/** One table. Fields are numbered as in the schema; scalars that are absent have their default. */
export class Table {
  private readonly vtable: number;
  private readonly fields: number;
  private readonly size: number;

  constructor(readonly buffer: FlatBuffer, private readonly at: number) {
    const view = buffer.view;
    buffer.inside(at, 4);
    this.vtable = at - view.getInt32(at, true);
    buffer.inside(this.vtable, 4);
    const bytes = view.getUint16(this.vtable, true);
    this.size = view.getUint16(this.vtable + 2, true);
    require(bytes >= 4 && bytes % 2 === 0 && this.size >= 4, "a damaged table");
    buffer.inside(this.vtable, bytes);
    buffer.inside(at, this.size);
    this.fields = (bytes - 4) / 2;
  }

  /** Where a field of `size` bytes lies; 0 when absent. */
  private field(index: number, size: number): number {
    if (index >= this.fields) return 0;
    const offset = this.buffer.view.getUint16(this.vtable + 4 + 2 * index, true);
    if (offset === 0) return 0;
    require(offset >= 4 && offset + size <= this.size, "a field outside its table");
    return this.at + offset;
  }

  u8(index: number, absent = 0): number {
    const at = this.field(index, 1);
    return at === 0 ? absent : this.buffer.view.getUint8(at);
  }
  i32(index: number, absent = 0): number {
    const at = this.field(index, 4);
    return at === 0 ? absent : this.buffer.view.getInt32(at, true);
  }
  u32(index: number, absent = 0): number {
    const at = this.field(index, 4);
    return at === 0 ? absent : this.buffer.view.getUint32(at, true);
  }
  f32(index: number, absent = 0): number {
    const at = this.field(index, 4);
    return at === 0 ? absent : this.buffer.view.getFloat32(at, true);
  }
  f64(index: number, absent = 0): number {
    const at = this.field(index, 8);
    return at === 0 ? absent : this.buffer.view.getFloat64(at, true);
  }
  i64(index: number): bigint {
    const at = this.field(index, 8);
    return at === 0 ? 0n : this.buffer.view.getBigInt64(at, true);
  }
  u64(index: number): bigint {
    const at = this.field(index, 8);
    return at === 0 ? 0n : this.buffer.view.getBigUint64(at, true);
  }

  /** Where a struct lies that must be there. */
  struct(index: number, size: number, what: string): number {
    const at = this.field(index, size);
    require(at !== 0, `${what} is missing`);
    return at;
  }

  has(index: number): boolean {
    return this.field(index, 1) !== 0;
  }

  u16(index: number): number {
    const at = this.field(index, 2);
    return at === 0 ? 0 : this.buffer.view.getUint16(at, true);
  }

  /** Where a struct lies; 0 where it is absent. */
  optionalStruct(index: number, size: number): number {
    return this.field(index, size);
  }

  table(index: number, what: string): Table {
    const at = this.field(index, 4);
    require(at !== 0, `${what} is missing`);
    return this.buffer.tableAt(this.buffer.follow(at));
  }

  /** Elements of a vector of scalars or structs; none when absent. */
  vector(index: number, elementBytes: number, most: number, what: string): Span {
    const field = this.field(index, 4);
    if (field === 0) return kNothing;
    const start = this.buffer.follow(field);
    const count = this.buffer.view.getUint32(start, true);
    require(count <= most, `too many ${what}`);
    this.buffer.inside(start + 4, count * elementBytes);
    this.buffer.spend(count * elementBytes);
    return { at: start + 4, count };
  }

  tables(index: number, most: number, what: string): Table[] {
    const span = this.vector(index, 4, most, what);
    const out: Table[] = [];
    for (let i = 0; i < span.count; ++i)
      out.push(this.buffer.tableAt(this.buffer.follow(span.at + 4 * i)));
    return out;
  }

  /** Strings of printable ASCII. */
  names(index: number, most: number, longest: number, what: string): string[] {
    const span = this.vector(index, 4, most, what);
    const out: string[] = [];
    for (let i = 0; i < span.count; ++i)
      out.push(this.text(this.buffer.follow(span.at + 4 * i), longest, what));
    return out;
  }

  /** The bytes themselves, not a copy; at least one. */
  payload(index: number, what: string): Uint8Array {
    const span = this.vector(index, 1, this.buffer.bytes.byteLength, what);
    require(span.count > 0, `${what} is empty`);
    return this.buffer.bytes.subarray(span.at, span.at + span.count);
  }

  /** Printable ASCII. */
  name(index: number, most: number, what: string): string {
    const field = this.field(index, 4);
    require(field !== 0, `${what} is missing`);
    return this.text(this.buffer.follow(field), most, what);
  }

  private text(start: number, most: number, what: string): string {
    const count = this.buffer.view.getUint32(start, true);
    require(count <= most, `too many characters in ${what}`);
    this.buffer.inside(start + 4, count + 1);
    this.buffer.spend(count);
    require(this.buffer.bytes[start + 4 + count] === 0, `${what} does not end`);
    const text = this.buffer.bytes.subarray(start + 4, start + 4 + count);
    require(text.every((c) => c >= 0x20 && c <= 0x7e), `${what} is not printable ASCII`);
    return String.fromCharCode(...text);
  }
}
