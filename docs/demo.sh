#!/usr/bin/env bash
# The whole path in five commands: a simulated robot, known only through the wire, is identified.
# `make demo` runs it; each command is shown before it is run, so that it can be typed as well.
set -euo pipefail
out=${1:-demo}
robot=tcp://127.0.0.1:${PORT:-5750}
seed=${SEED:-1}

show() { printf '\n\033[1m$ %s\033[0m\n' "$*"; "$@"; }

rm -rf "$out"
mkdir -p "$out"

printf '\033[1m$ sim-robotd --bind %s --seed %s &\033[0m\n' "$robot" "$seed"
sim-robotd --bind "$robot" --seed "$seed" 2> "$out/sim-robotd.log" &
daemon=$!
trap 'kill "$daemon" 2> /dev/null || true' EXIT
until grep -q serving "$out/sim-robotd.log"; do
    kill -0 "$daemon" 2> /dev/null || { cat "$out/sim-robotd.log" >&2; exit 1; }
    sleep 0.1
done

show estimator identify --robot "$robot" --problem parametric --seed "$seed" --out "$out/run"
show estimator validate "$out/run" --robot "$robot"

# Only now, to score the result, do we look at the robot's true body.
printf '\n\033[1m$ sim-robotd --print-body > %s/truth.urdf\033[0m\n' "$out"
sim-robotd --print-body > "$out/truth.urdf"
show estimator score "$out/run" --truth "$out/truth.urdf"

printf '\nThe run: %s\nIts plots: %s\n' "$out/run" "$(ls -d "$out"/run/plots/*.png | tr '\n' ' ')"
