#!/usr/bin/env bash
# The whole path: a simulated robot, known only through the wire, is identified in two ways.
# `make demo` runs it; each command is shown before it is run, so that it can be typed as well.
# `make demo ELECTRONICS=pi` does it on the chips of a Raspberry Pi. The robot takes a free port.
set -euo pipefail
out=${1:-demo}
seed=${SEED:-1}
electronics=${ELECTRONICS:-pc104}

show() { printf '\n\033[1m$ %s\033[0m\n' "$*"; "$@"; }

rm -rf "$out"
mkdir -p "$out"

bind='tcp://127.0.0.1:*'
printf "\033[1m$ sim-robotd --bind '%s' --seed %s --electronics %s &\033[0m\n" "$bind" "$seed" \
    "$electronics"
sim-robotd --bind "$bind" --seed "$seed" --electronics "$electronics" 2> "$out/sim-robotd.log" &
daemon=$!
trap 'kill "$daemon" 2> /dev/null || true' EXIT
until grep -q serving "$out/sim-robotd.log"; do
    kill -0 "$daemon" 2> /dev/null || { cat "$out/sim-robotd.log" >&2; exit 1; }
    sleep 0.1
done
robot=$(grep -m 1 -o 'serving [^,]*' "$out/sim-robotd.log" | grep -o 'tcp://.*')
printf 'The robot is at %s\n' "$robot"

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
