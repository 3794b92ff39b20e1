#!/usr/bin/env bash
# Life after identification: a robot is identified and takes a pose; another process cuts one of its legs;
# it notices, finds out what has changed, and takes the pose with the body that it has now.
# `make demo-damage` runs it, in a minute or two; each command is shown before it is run.
set -euo pipefail
out=${1:-demo-damage}
seed=${SEED:-1}
damage=${DAMAGE:-body.cut=2:70}

. "$(dirname "$0")/start-simulator.sh"
control="ipc://$PWD/$out/control"
start_simulator --control "$control" --seed "$seed"
pose="--tilt-forward 5 --tilt-left 0 --yes"

# Which legs has it, and how long are they? Then: stand with the nose up by 5 degrees.
show estimator identify --robot "$robot" --problem topological --interactions 8 --seed "$seed" --out "$out/body"
show estimator pose "$out/body" --robot "$robot" $pose

# Nothing has happened yet, and the watch says so.
show estimator monitor "$out/body" --robot "$robot" --once --yes

# Another process cuts the front leg. The robot's daemon knows nothing of it.
show python -m sim_robot.faults.control_socket "$control" inject "$damage"
changed=0
show estimator monitor "$out/body" --robot "$robot" --every 1 --movements 30 --yes || changed=$?
[ "$changed" = 3 ] || { echo "not noticed: exit code $changed" >&2; exit 1; }

# What is it? And the same pose, with the body that is left.
show estimator diagnose "$out/body" --robot "$robot" --yes --out "$out/body-now"
show estimator pose "$out/body-now" --robot "$robot" $pose || true
show estimator compare "$out/body" "$out/body-now" --out "$out/before-and-now.png"

printf '\nThe story as pages: %s\n' "$out/body/report.html, $out/body-now/report.html, $out/before-and-now.png"
