// hello, acquire, perform, another perform that a stop ends, clear, release:
//     node session.mjs tcp://host:port ANGLE
// Prints what the robot answered, as JSON.

import { Refused, Robot } from "./robot.mjs";

const [address, angle] = process.argv.slice(2);
const robot = new Robot();
try {
  const capabilities = await robot.open(address);
  await robot.ask("acquire");
  robot.keepAlive();
  const targets = Object.fromEntries(capabilities.joints.map(({ name }) => [name, Number(angle)]));
  const performed = await robot.ask("perform", { targets });
  let stop;
  const ended = await robot
    .ask("perform", { targets }, () => (stop ??= robot.ask("stop")))
    .catch((error) => error.code);
  const stopped = await stop;
  const refused = await robot.ask("perform", { targets }).catch((error) => error.code);
  const cleared = await robot.ask("clear");
  const status = await robot.ask("heartbeat");
  const released = await robot.ask("release");
  console.log(JSON.stringify({ performed, ended, stopped, refused, cleared, status, released, heard: robot.heard }));
} catch (error) {
  console.error(error instanceof Refused ? error.message : `no session: ${error.message}`);
  process.exitCode = 1;
} finally {
  robot.close();
}
