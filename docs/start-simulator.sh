# Sourced by the demonstrations: starts sim-robotd on a free port with the options that are given, and
# has its address in $robot. `show` shows a command and runs it. The robot ends with the script.
show() { printf '\n\033[1m$ %s\033[0m\n' "$*"; "$@"; }

rm -rf "$out"
mkdir -p "$out"

start_simulator() {
    local bind='tcp://127.0.0.1:*'
    printf "\033[1m$ sim-robotd --bind '%s' %s &\033[0m\n" "$bind" "$*"
    sim-robotd --bind "$bind" "$@" 2> "$out/sim-robotd.log" &
    daemon=$!
    trap 'kill "$daemon" 2> /dev/null || true' EXIT
    until grep -q serving "$out/sim-robotd.log"; do
        kill -0 "$daemon" 2> /dev/null || { cat "$out/sim-robotd.log" >&2; exit 1; }
        sleep 0.1
    done
    robot=$(grep -m 1 -o 'serving [^,]*' "$out/sim-robotd.log" | grep -o 'tcp://.*')
    printf 'The robot is at %s\n' "$robot"
}
