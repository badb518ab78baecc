#!/bin/sh
# What `make demo` runs: a hidden effect found, and the paper's delayed plant labelled. Needs `dsd` on the PATH; writes into out/.
set -eu
cd "$(dirname "$0")/.."
mkdir -p out

say() {
    printf '\n%s\n' "$1"
}

run() {
    printf '\n$ %s\n' "$*"
    "$@"
}

# the first lines of what a command says; all of it is in the file
begin() {
    lines=$1 file=$2
    shift 2
    printf '\n$ %s\n' "$*"
    "$@" >"$file"
    head -n "$lines" "$file"
    echo "... (all of it: $file)"
}

can() {
    dsd "$1" --help 2>/dev/null | grep -q -e "$2"
}

say "A. WHAT IS MISSING? An axis with friction, and a model (sample_logs/servo-bare.toml) that knows of none."
run dsd simulate -c sample_logs/servo-friction.toml --duration 6 --seed 7 -o out/hidden.csv

say "1. Can this log answer? Signs, units, clock, excitation, sensor."
run dsd check out/hidden.csv -c sample_logs/servo-bare.toml

say "2. Compare: how well does the model predict the log, and where does it fail?"
begin 12 out/compare.txt dsd compare out/hidden.csv -c sample_logs/servo-bare.toml --plot out/compare.png
tail -n 1 out/compare.txt

say "3. Diagnose: which effect of the catalogue explains data that no fit has seen?"
begin 14 out/diagnose.txt dsd diagnose out/hidden.csv -c sample_logs/servo-bare.toml --plot out/diagnose.png

say "4. Improve: add it, fit, measure again, until nothing is missing."
run dsd improve out/hidden.csv -c sample_logs/servo-bare.toml --auto --states -o out/better.toml --plot out/improve.png

cat <<'TEXT'

How to read it:
  - The log was made with 0.15 N m of Coulomb and 0.01 N m s/rad of viscous friction. The model did not know; out/better.toml has both, with
    comments and history, and the inertia and delay of the simulated axis (0.01 kg m2, 2 ms).
  - "held-out" is data that no fit saw; an effect counts only if it explains that. What is left at the end is the sensor's noise.
TEXT

if can export '[-]-plot'; then
    say "5. Carry it out: the learnt model as a joint of MuJoCo, played there beside dsd simulate (out/mujoco.png has both curves)."
    run dsd export out/better.toml --to mjcf -o out/joint.xml --plot out/mujoco.png
fi

if can report html; then
    say "6. The whole story on one page, for a browser."
    run dsd report out/hidden.csv -c sample_logs/servo-bare.toml -o out/report.html
fi

if can plan run-with; then
    say "7. An arm that made only short moves: gravity, or a constant load? Plan the motion that decides, run it, diagnose both logs."
    run dsd simulate -c sample_logs/servo-arm.toml -o out/short.csv --quiet
    begin 1 out/tie.txt dsd diagnose out/short.csv -c sample_logs/servo-arm-bare.toml
    rm -f out/next-*
    begin 3 out/plan.txt dsd plan out/short.csv -c sample_logs/servo-arm-bare.toml -o out/next.csv --plot out/plan.png \
        --run-with "dsd simulate --quiet -c sample_logs/servo-arm.toml --reference {reference} -o {log}"
fi

say "B. WHICH STATE NOW? The paper's delayed plant follows a sine; at 1.5 s its delay jumps from 0.3 s to 0.4 s."
run dsd simulate -c sample_logs/demo.toml -o out/log.csv

say "8. Detect: which of 3 delays x 3 inertias explains u and d_hat, sample by sample?"
if can detect '[-]-plot'; then
    run dsd detect out/log.csv -c sample_logs/demo.toml -o out/labels.csv --plot out/detect.png
else
    run dsd detect out/log.csv -c sample_logs/demo.toml -o out/labels.csv
fi

cat <<'TEXT'

How to read it:
  - Up to 0.45 s (the largest candidate delay and 5 tau) nothing can be judged: the initial label stands, not confident.
  - Then the label is delay 0.3 s, inertia 1, as simulated. After the change at 1.5 s the window of 0.1 s holds samples from
    before and after: the delay label follows within some 30 ms, the inertia label passes through 2 until the window is clean.
  - What the labels leave unexplained is below rho: these candidates explain the log. Every label is in out/labels.csv.

9. Check, as in a pipeline: the exit code is 0 if 95 % of the labels are as expected, else 3.
TEXT
expect() {
    printf '\n$ dsd detect out/log.csv -c sample_logs/demo.toml --after 1.6 --expect %s\n' "$1"
    status=0
    dsd detect out/log.csv -c sample_logs/demo.toml --after 1.6 --expect "$1" --quiet >out/check.txt 2>&1 || status=$?
    grep expect out/check.txt
    echo "exit code $status"
    test "$status" = "$2"
}

expect delay=0.4 0
expect delay=0.3 3

say "To look at, in out/: $(cd out && ls -- *.png *.html 2>/dev/null | tr '\n' ' ')"
printf '\nNext, with a log of your own: dsd init LOG; dsd check LOG; dsd diagnose LOG. README.md has the rest.\n'
