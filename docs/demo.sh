#!/usr/bin/env bash
# The whole path: a simulated robot, known only through the wire, is identified in two ways.
# `make demo` runs it; each command is shown before it is run, so that it can be typed as well.
# `make demo ELECTRONICS=pi` does it on the chips of a Raspberry Pi. The robot takes a free port.
set -euo pipefail
out=${1:-demo}
seed=${SEED:-2}
electronics=${ELECTRONICS:-pc104}

. "$(dirname "$0")/start-simulator.sh"
start_simulator --seed "$seed" --electronics "$electronics"

# The paper's way: one population of models, optimised, and movements drawn at random.
show estimator identify --robot "$robot" --problem parametric --method paper --seed "$seed" \
    --out "$out/paper"

# The whole body from nothing: every body that explains the readings, and movements that decide.
show estimator identify --robot "$robot" --problem topological --interactions 6 --seed "$seed" \
    --out "$out/body"
show estimator validate "$out/body" --robot "$robot"

# Only now, to score the result, do we look at the robot's true body.
printf '\n\033[1m$ sim-robotd --print-body > %s/truth.urdf\033[0m\n' "$out"
sim-robotd --print-body > "$out/truth.urdf"
show estimator score "$out/paper" --truth "$out/truth.urdf"
show estimator score "$out/body" --truth "$out/truth.urdf"

printf '\nPlots:\n%s\n' "$(ls -d "$out"/*/plots/*.png)"
