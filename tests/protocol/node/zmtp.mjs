// A DEALER of one connection: ZMTP 3.0 (RFC 23) with the NULL mechanism, over node:net.

import { connect } from "node:net";

const MORE = 1;
const LONG = 2;
const COMMAND = 4;
const MAX_MESSAGE = 1 << 20; // SPEC.md, [1.6]

const GREETING = Buffer.alloc(64);
GREETING.set([0xff, 0, 0, 0, 0, 0, 0, 0, 1, 0x7f, 3, 0]);
GREETING.write("NULL", 12, "ascii");

function property(name, value) {
  const size = Buffer.alloc(4);
  size.writeUInt32BE(value.length);
  return [Buffer.from([name.length]), Buffer.from(name, "ascii"), size, Buffer.from(value, "ascii")];
}

const READY = Buffer.concat([
  Buffer.from([5]), Buffer.from("READY", "ascii"),
  ...property("Socket-Type", "DEALER"), ...property("Identity", ""),
]);

function framed(flags, body) {
  if (body.length < 256) return Buffer.concat([Buffer.from([flags, body.length]), body]);
  const head = Buffer.alloc(9);
  head[0] = flags | LONG;
  head.writeBigUInt64BE(BigInt(body.length), 1);
  return Buffer.concat([head, body]);
}

/** Connects; `onMessage` gets each message as an array of its parts. */
export class Dealer {
  constructor(host, port, { onMessage, onClose }) {
    this.waiting = Buffer.alloc(0);
    this.parts = [];
    this.greeted = false;
    this.onMessage = onMessage;
    this.ready = new Promise((resolve, reject) => {
      this.onReady = resolve;
      this.socket = connect({ host, port, noDelay: true });
      const fail = (error) => {
        reject(error);
        onClose(error);
      };
      this.socket.on("connect", () => this.socket.write(GREETING));
      this.socket.on("error", fail);
      this.socket.on("close", () => fail(new Error("the connection is closed")));
      this.socket.on("data", (bytes) => {
        try {
          this.receive(bytes);
        } catch (error) {
          this.socket.destroy(error);
        }
      });
    });
  }

  /** Sends one message of one part. */
  send(part) {
    this.socket.write(framed(0, part));
  }

  close() {
    this.socket.removeAllListeners("close");
    this.socket.end();
  }

  receive(bytes) {
    this.waiting = Buffer.concat([this.waiting, bytes]);
    if (!this.greeted) {
      if (this.waiting.length < 64) return;
      const mechanism = this.waiting.toString("ascii", 12, 32).replace(/\0+$/, "");
      if (mechanism !== "NULL") throw new Error(`the robot asks for ${mechanism}`);
      this.waiting = this.waiting.subarray(64);
      this.greeted = true;
      this.socket.write(framed(COMMAND, READY));
    }
    for (let frame = this.next(); frame !== null; frame = this.next()) this.take(...frame);
  }

  next() {
    const bytes = this.waiting;
    if (bytes.length < 2) return null;
    const long = (bytes[0] & LONG) !== 0;
    if (long && bytes.length < 9) return null;
    const size = long ? Number(bytes.readBigUInt64BE(1)) : bytes[1];
    const start = long ? 9 : 2;
    if (size > MAX_MESSAGE) throw new Error(`a frame of ${size} bytes`);
    if (bytes.length < start + size) return null;
    this.waiting = bytes.subarray(start + size);
    return [bytes[0], bytes.subarray(start, start + size)];
  }

  take(flags, body) {
    if (flags & COMMAND) {
      const name = body.toString("ascii", 1, 1 + body[0]);
      if (name === "READY") this.onReady();
      if (name === "ERROR") throw new Error(`the robot refuses: ${body.toString("ascii", 7)}`);
      return;
    }
    this.parts.push(body);
    if (flags & MORE) return;
    const parts = this.parts;
    this.parts = [];
    this.onMessage(parts);
  }
}
