// Frames of SPEC.md, section 2: MessagePack to values and back.
//
// JavaScript has one type of number, so 1.0 and 1 are the same value once decoded. Whoever has to
// tell an integer from a float, as [2.7] asks of a robot, decodes with { markFloats: true }.

const MAX_FRAME = 65536;
const MAX_NESTING = 16;
const MAX_LENGTH = 1024;

/** Bytes that are no frame; `id` is the request's, where [2.12] lets the error carry it. */
export class Malformed extends Error {
  constructor(message, code = "malformed", id = undefined) {
    super(message);
    this.code = code;
    this.id = id;
  }
}

/** A number that came as a float. */
export class Float {
  constructor(value) {
    this.value = value;
  }
}

/** A value that MessagePack knows, but no frame may hold. */
class Forbidden {
  constructor(what) {
    this.what = what;
  }
}

class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
    this.utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });
  }

  take(count) {
    if (this.at + count > this.bytes.length) throw new Malformed("The frame ends too soon.");
    this.at += count;
    return this.bytes.subarray(this.at - count, this.at);
  }

  unsigned(width) {
    return width === 8 ? this.take(8).readBigUInt64BE() : this.take(width).readUIntBE(0, width);
  }

  text(length) {
    try {
      return this.utf8.decode(this.take(length));
    } catch (error) {
      if (error instanceof Malformed) throw error;
      throw new Malformed("A string is not UTF-8.");
    }
  }

  array(length) {
    if (length > MAX_LENGTH) throw new Malformed("An array is too long.");
    return Array.from({ length }, () => this.value());
  }

  map(length) {
    if (length > MAX_LENGTH) throw new Malformed("A map is too long.");
    const found = new Map(); // an object would take "__proto__" for something else
    for (let count = 0; count < length; count += 1) {
      const key = this.value();
      if (typeof key !== "string") throw new Malformed("A key is no string.");
      if (found.has(key)) throw new Malformed(`The key ${key} comes twice.`);
      found.set(key, this.value());
    }
    return found;
  }

  value() {
    const tag = this.unsigned(1);
    if (tag < 0x80) return BigInt(tag);
    if (tag < 0x90) return this.map(tag & 0x0f);
    if (tag < 0xa0) return this.array(tag & 0x0f);
    if (tag < 0xc0) return this.text(tag & 0x1f);
    if (tag >= 0xe0) return BigInt(tag - 0x100);
    switch (tag) {
      case 0xc0: return null;
      case 0xc2: return false;
      case 0xc3: return true;
      case 0xc4: case 0xc5: case 0xc6:
        this.take(this.unsigned(1 << (tag - 0xc4)));
        return new Forbidden("binary");
      case 0xca: return new Float(this.take(4).readFloatBE());
      case 0xcb: return new Float(this.take(8).readDoubleBE());
      case 0xcc: case 0xcd: case 0xce: case 0xcf:
        return BigInt(this.unsigned(1 << (tag - 0xcc)));
      case 0xd0: return BigInt(this.take(1).readInt8());
      case 0xd1: return BigInt(this.take(2).readInt16BE());
      case 0xd2: return BigInt(this.take(4).readInt32BE());
      case 0xd3: return this.take(8).readBigInt64BE();
      case 0xd9: case 0xda: case 0xdb: return this.text(this.unsigned(1 << (tag - 0xd9)));
      case 0xdc: case 0xdd: return this.array(this.unsigned(tag === 0xdc ? 2 : 4));
      case 0xde: case 0xdf: return this.map(this.unsigned(tag === 0xde ? 2 : 4));
      default: throw new Malformed(`The byte ${tag.toString(16)} begins nothing that is allowed.`);
    }
  }
}

function allowed(value, depth, markFloats) {
  if (value instanceof Forbidden) throw new Malformed(`A frame cannot hold ${value.what}.`);
  if (typeof value === "bigint") {
    const number = Number(value);
    if (!Number.isSafeInteger(number)) throw new Malformed(`The integer ${value} is too large.`);
    return number;
  }
  if (value instanceof Float) {
    if (!Number.isFinite(value.value)) throw new Malformed(`The number ${value.value}.`);
    return markFloats ? value : value.value;
  }
  if (value === null || typeof value !== "object") return value;
  if (depth > MAX_NESTING) throw new Malformed("It is nested too deeply.");
  if (Array.isArray(value)) return value.map((item) => allowed(item, depth + 1, markFloats));
  const entries = [...value].map(([key, item]) => [key, allowed(item, depth + 1, markFloats)]);
  return Object.fromEntries(entries);
}

/** The map in a frame, as an object. */
export function decode(bytes, { markFloats = false } = {}) {
  if (bytes.length > MAX_FRAME) throw new Malformed("The frame is too long.", "too_large");
  const reader = new Reader(bytes);
  const found = reader.value();
  if (reader.at !== bytes.length) throw new Malformed("Something follows the frame.");
  if (!(found instanceof Map)) throw new Malformed("The frame is no map.");
  try {
    return allowed(found, 1, markFloats);
  } catch (error) {
    const id = found.get("id");
    if (typeof id === "bigint" && id >= 0n && Number.isSafeInteger(Number(id))) error.id = Number(id);
    throw error;
  }
}

function head(short, longest, tags, length) {
  if (length < longest) return Buffer.from([short | length]);
  const width = tags.length === 3 && length < 0x100 ? 1 : length < 0x10000 ? 2 : 4;
  const bytes = Buffer.alloc(1 + width);
  bytes[0] = tags[tags.length - (width === 4 ? 1 : width === 2 ? 2 : 3)];
  bytes.writeUIntBE(length, 1, width);
  return bytes;
}

/** A value as MessagePack; whole numbers go as integers, which every float field accepts [2.6]. */
export function encode(value) {
  if (value === null) return Buffer.from([0xc0]);
  if (typeof value === "boolean") return Buffer.from([value ? 0xc3 : 0xc2]);
  if (typeof value === "string") {
    const bytes = Buffer.from(value, "utf8");
    return Buffer.concat([head(0xa0, 32, [0xd9, 0xda, 0xdb], bytes.length), bytes]);
  }
  if (Number.isSafeInteger(value) && !Object.is(value, -0)) {
    if (value >= 0 && value < 0x80) return Buffer.from([value]);
    const bytes = Buffer.alloc(9);
    bytes[0] = 0xd3;
    bytes.writeBigInt64BE(BigInt(value), 1);
    return bytes;
  }
  if (typeof value === "number") {
    const bytes = Buffer.alloc(9);
    bytes[0] = 0xcb;
    bytes.writeDoubleBE(value, 1);
    return bytes;
  }
  if (Array.isArray(value)) {
    return Buffer.concat([head(0x90, 16, [0xdc, 0xdd], value.length), ...value.map(encode)]);
  }
  const entries = Object.entries(value);
  return Buffer.concat([head(0x80, 16, [0xde, 0xdf], entries.length), ...entries.flat().map(encode)]);
}
