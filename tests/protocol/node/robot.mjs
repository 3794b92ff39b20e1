// A client written from SPEC.md alone: the checklist of section 13, without telemetry and keys.

import { randomUUID } from "node:crypto";
import { decode, encode } from "./msgpack.mjs";
import { Dealer } from "./zmtp.mjs";

const RESEND = 2000; // ms, [4.13]
const PATIENCE = 20000; // ms
const BEAT = 1000; // ms, [5.5]

/** A request that was answered with an error; `code` is one of section 8. */
export class Refused extends Error {
  constructor({ code, message, advice }) {
    super(`${code}: ${message} ${advice}`);
    this.code = code;
  }
}

/** One session with a robot without keys. */
export class Robot {
  constructor() {
    this.client = randomUUID();
    this.session = undefined;
    this.numbered = 1;
    this.loose = 2 ** 52; // [4.14]
    this.waiting = new Map();
    this.heard = []; // the types of all answers, in order
  }

  /** Connects and says hello; returns the capabilities. */
  async open(address) {
    const [, host, port] = /^tcp:\/\/(.*):(\d+)$/.exec(address);
    this.dealer = new Dealer(host, Number(port), {
      onMessage: (parts) => this.receive(parts),
      onClose: (error) => this.fail(error),
    });
    await this.dealer.ready;
    const welcome = await this.ask("hello", { versions: [1], software: "node 1" });
    if (welcome.version !== 1) throw new Error(`the robot speaks version ${welcome.version}`);
    this.session = welcome.session;
    return welcome.capabilities;
  }

  /** Sends a heartbeat every second from now on. */
  keepAlive() {
    this.beat = setInterval(() => this.ask("heartbeat").catch(() => {}), BEAT);
  }

  /** The final reply to a request; `onReply` gets those before it. */
  ask(type, fields = {}, onReply = () => {}) {
    const loose = ["hello", "heartbeat", "stop"].includes(type);
    const id = loose ? this.loose++ : this.numbered++;
    const request = { type, id, client: this.client, ...fields };
    if (this.session !== undefined) request.session = this.session;
    const frame = encode(request);
    return new Promise((resolve, reject) => {
      const resend = setInterval(() => this.dealer.send(frame), RESEND); // the same id: done once
      const end = (finish) => (value) => {
        clearInterval(resend);
        clearTimeout(patience);
        this.waiting.delete(id);
        finish(value);
      };
      const patience = setTimeout(() => end(reject)(new Error(`${type} is not answered`)), PATIENCE);
      this.waiting.set(id, { resolve: end(resolve), reject: end(reject), onReply });
      this.dealer.send(frame);
    });
  }

  receive(parts) {
    if (parts.length !== 1) throw new Error(`an answer of ${parts.length} parts`);
    const reply = decode(parts[0]);
    this.heard.push(reply.type);
    const asker = this.waiting.get(reply.id);
    if (asker === undefined) return; // a repeated request may be answered twice
    if (reply.type === "error") asker.reject(new Refused(reply));
    else if (["accepted", "progress"].includes(reply.type)) asker.onReply(reply);
    else asker.resolve(reply);
  }

  fail(error) {
    for (const asker of [...this.waiting.values()]) asker.reject(error);
  }

  close() {
    clearInterval(this.beat);
    this.dealer.close();
  }
}
