#!/bin/sh
# Writes docs/report.md: the figures and numbers of "Optimization using Finite Element Models"
# (T. Dehaeze, 2025), and what plantbus gives for each, from the tools' own output on the shipped plants.
# Usage: scripts/report.sh [--elements DIR] [--bin DIR] [-o FILE]
#   --elements DIR  a column more, from APA300ML.mat and flexor_025.mat in DIR (exported from Ansys)
#   --bin DIR       where the tools are (build/bin)
#   -o FILE         what is written (docs/report.md)
set -eu
cd "$(dirname "$0")/.."

bin=build/bin
out=docs/report.md
elements=""
while [ $# -gt 0 ]; do
  case "$1" in
  --elements) elements=$2; shift 2 ;;
  --bin) bin=$2; shift 2 ;;
  -o) out=$2; shift 2 ;;
  *) echo "usage: scripts/report.sh [--elements DIR] [--bin DIR] [-o FILE]" >&2; exit 2 ;;
  esac
done
for tool in actuator joint study control model; do
  [ -x "$bin/plantbus-$tool" ] || { echo "report.sh: build plantbus-$tool first (./test.sh)" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# run NAME TOOL ARGUMENTS…: the tool's JSON as lines of "pointer value" in $work/NAME.
run() {
  name=$1; tool=$2; shift 2
  echo "  plantbus-$tool $1" >&2
  "$bin/plantbus-$tool" "$@" --json >"$work/json" || { echo "report.sh: plantbus-$tool $* failed" >&2; exit 1; }
  awk -f scripts/json-flat.awk "$work/json" >"$work/$name"
}

value() { # NAME POINTER: the value, or nothing
  if [ -f "$work/$1" ]; then awk -F'\t' -v p="$2" '$1 == p { print $2; exit }' "$work/$1"; fi
}

# ---- what the tools say --------------------------------------------------------------------------

apa=config/elements/apa300ml.mat
joint=config/elements/flexible-joint.mat
bench95=config/plants/apa95ml-bench.json
two=config/plants/nano-hexapod.json
one=config/plants/nano-hexapod-1dof.json
stiff=config/plants/nano-hexapod-element-joints.json

# As in config/plants/nano-hexapod-elements.json, to stand beside the 2-DoF model in one study.
fem='{"type":"super_element","file":"../elements/apa300ml.mat","modal_damping":0.01,
 "rayleigh":{"alpha":0,"beta":1e-5},"ends":[1,2],"half_height":0.015,"g_a":26.1,"g_s":5060000,"polarity":-1,
 "stacks":{"sensor":{"frames":["3","4"],"axis":[1,0,0]},"actuator":{"frames":["5","7"],"axis":[1,0,0]}}}'
soft='{"type":"strut_1dof","k":1e4,"c":1,"mass":0.112,"radius":0.02}'
# The report's struts have 95 mm from joint to joint, the template 82.5 mm: the same plant, higher.
sed 's/"top_height": 0.0725/"top_height": 0.091212/' "$one" >"$work/higher.json"

run constants actuator constants
run actuator actuator characterize "$apa"
run select actuator select
run actuator95 actuator characterize config/elements/apa95ml.mat --datasheet config/actuators/apa95ml.json
run info95 model info "$bench95"
run modes95 model modes "$bench95"
run zeros95 model zeros "$bench95" --input Va --output Vs
run best95 control iff "$bench95"
iff_gains="100 200 400 800"
for g in $iff_gains; do run "iff95_$g" control iff "$bench95" --gain "$g"; done
awk -f scripts/json-flat.awk config/parts/apa95ml.json >"$work/part95"
run fit actuator fit "$apa" --load 5
run boundary actuator boundary "$apa" --load 5
run joint joint characterize "$joint"
run bending1 study bending "$one"
run bending2 study bending "$two"
run axial study axial "$two"
run joints study joint-model "$stiff"
run length study actuator-model "$one" --values 1dof
run higher study actuator-model "$work/higher.json" --values 1dof,soft --model "soft=$soft"
run struts study actuator-model "$two" --values 2dof,fem --model "fem=$fem"
run bench model info config/plants/apa300ml-bench.json
run modes model modes config/plants/apa300ml-bench.json
run zeros model zeros config/plants/apa300ml-bench.json --input Va --output Vs
if [ -n "$elements" ]; then
  run actuator_x actuator characterize "$elements/APA300ML.mat"
  run fit_x actuator fit "$elements/APA300ML.mat" --load 5
  run boundary_x actuator boundary "$elements/APA300ML.mat" --load 5
  run joint_x joint characterize "$elements/flexor_025.mat"
fi

# ---- rows ----------------------------------------------------------------------------------------

# cell VALUE SCALE: four digits, or – where there is nothing.
cell() {
  case "$1" in
  "" | null) printf '–' ;;
  *) awk -v v="$1" -v s="$2" 'BEGIN { printf "%.4g", v * s }' ;;
  esac
}

# row WHERE WHAT REPORT UNIT SCALE NAME POINTER [REMARK]: REPORT "" where the report has a figure only.
row() {
  got=$(value "$6" "$7")
  difference=""
  if [ -n "$3" ] && [ -n "$got" ] && [ "$got" != null ]; then
    difference=$(awk -v r="$3" -v v="$got" -v s="$5" 'BEGIN { printf "%+.1f %%", 100 * (v * s / r - 1) }')
  fi
  printf '| %s | %s | %s | %s | %s |' "$1" "$2" "${3:-–} $4" "$(cell "$got" "$5")" "$difference"
  if [ -n "$elements" ]; then printf ' %s |' "$(cell "$(value "$6_x" "$7")" "$5")"; fi
  printf ' %s |\n' "${8:-}"
}

head_row() {
  printf '\n| report | quantity | report says | plantbus | difference |'
  if [ -n "$elements" ]; then printf ' Ansys element |'; fi
  printf ' remark |\n|---|---|---|---|---|'
  if [ -n "$elements" ]; then printf -- '---|'; fi
  printf -- '---|\n'
}

# A line a value of a study: VALUES of quantity, then columns "title;pointer below a value;scale".
study_table() { # NAME TITLE COLUMN…
  name=$1; title=$2; shift 2
  printf '\n| %s |' "$title"
  for column in "$@"; do printf ' %s |' "${column%%;*}"; done
  printf '\n|---|'
  for column in "$@"; do printf -- '---|'; done
  printf '\n'
  k=0
  while label=$(value "$name" "/values/$k/value") && [ -n "$label" ]; do
    printf '| %s |' "$label"
    for column in "$@"; do
      rest=${column#*;}
      printf ' %s |' "$(cell "$(value "$name" "/values/$k/${rest%%;*}")" "${rest#*;}")"
    done
    printf '\n'
    k=$((k + 1))
  done
}

damping_columns() {
  for m in 0 1 2 3 4 5; do printf 'mode %d [%%];attainable_damping/%d;100\n' $((m + 1)) $m; done
}

selection() {
  printf '\n| actuator | verdict | stroke | stiffness | resolution | blocked force | height |\n|---|---|---|---|---|---|---|\n'
  k=0
  while label=$(value select "/actuators/$k/name") && [ -n "$label" ]; do
    printf '| %s | %s |' "$label" "$(value select "/actuators/$k/verdict")"
    for limit in stroke stiffness resolution blocked_force height; do
      printf ' %s |' "$(value select "/actuators/$k/limits/$limit/verdict")"
    done
    printf '\n'
    k=$((k + 1))
  done
}

# A line a gain of the APA95ML bench's IFF, then the best.
iff_line() { # NAME REMARK
  printf '| %s | %s | %s | %s |\n' "$(cell "$(value "$1" /controller/gain)" 1)" \
    "$(cell "$(value "$1" /modes/0/closed_predicted/hz)" 1)" \
    "$(cell "$(value "$1" /modes/0/closed_predicted/damping)" 100)" "$2"
}

iff_table() {
  printf '\n| gain g of eq. 1.4 | suspension mode [Hz] | its damping [%%] | remark |\n|---|---|---|---|\n'
  printf '| 0 | %s | %s | undamped |\n' "$(cell "$(value best95 /modes/0/open_exact/hz)" 1)" \
    "$(cell "$(value best95 /modes/0/open_exact/damping)" 100)"
  for g in $iff_gains; do iff_line "iff95_$g" ''; done
  iff_line best95 'most damping among the gains that can be doubled'
}

damping="follows from the damping given to the element, here 1 % of each free mode"

document() {
cat <<'TEXT'
# The report's figures and numbers, and plantbus'

"Optimization using Finite Element Models" (T. Dehaeze, 2025) beside what plantbus gives. Written by `scripts/report.sh` from
the tools' `--json` output on the shipped plants and parts (`config/`); run it to have it from your own build. The shipped elements
are built by `plantbus-part` from dimensions; the report's were exported from Ansys.
TEXT
[ -z "$elements" ] || printf 'The column "Ansys element" is the same with elements exported from Ansys.\n'

printf '\n## Piezoelectric constants (1.2)\n'
head_row
row 'Table 1.3' 'stiffness of one stack' 235 'N/µm' 1e-6 actuator /stack_stiffness 'report: data sheet'
row 'eq. 1.3a, Table 1.4' 'actuator constant g_a' 26.1 'N/V' 1 constants /g_a
row 'eq. 1.3b, Table 1.4' 'sensor constant g_s' 5.06 'V/µm' 1e-6 constants /g_s

row 'Table 1.3' 'capacitance of one stack' 4.4 'µF' 1e6 constants /capacitance 'n² ε^T A/L with Table 1.4; `boundary` takes the 4.4 µF'
row 'Table 1.4' 'coupling k_33' '' '' 1 constants /coupling 'from d_33, ε^T, s^D'

printf '\n## The bench with the APA95ML (1; mesh, responses, root locus and damped plants: figures 1.2 to 1.6)\n'
printf '\n### The element (`plantbus-part build config/parts/apa95ml.json`, `plantbus-actuator characterize`)\n'
head_row
row '1' 'axial stiffness' 16 'N/µm' 1e-6 actuator95 /stiffness 'data sheet'
row '1' 'stroke' 100 'µm' 1e6 actuator95 /stroke 'data sheet'
row '1' 'blocked force' 1600 'N' 1 actuator95 /blocked_force 'data sheet'
row 'Table 1.2' 'modulus of the shell' 190 'GPa' 1e-9 part95 /materials/shell/youngs_modulus 'given to the part'
row 'Table 1.2' 'modulus of the stacks' 49.5 'GPa' 1e-9 part95 /materials/stack/youngs_modulus 'given to the part'
row '1.1' 'mesh' '' '' 1 none none '`plantbus-part build config/parts/apa95ml.json --picture mesh.png -o apa95ml.mat`'
printf '\n### Its responses with the granite of 5.7 kg, amplifier × 20 (`plantbus-model`, `plantbus-control iff`)\n'
head_row
row '1.2' 'V_a → y at 0 Hz' '' 'µm/V' 1e6 info95 /dc_gain/1/0 '`plantbus-model frf config/plants/apa95ml-bench.json --input Va --output y -o y.png`'
row '1.2' 'V_a → V_s at 0 Hz' '' 'V/V' 1 info95 /dc_gain/0/0 'the same with `--output Vs`'
row '1.2' 'pole' '' 'Hz' 1 modes95 /modes_hz/0
row '1.2' 'zero of V_a → V_s' '' 'Hz' 1 zeros95 /zeros_hz/0 'below the pole: poles and zeros alternate'
row '1.2' 'next mode' '' 'Hz' 1 modes95 /modes_hz/1
row '1.2' 'root locus, damped plants' '' '' 1 none none '`plantbus-control iff config/plants/apa95ml-bench.json --plot`, with `--gain` for one of the table'
printf '\nIntegral force feedback, eq. 1.4:\n'
iff_table
printf '\nTo measure all this as the bench did: `plantbusd --plant config/plants/apa95ml-bench.json`, then `plantbus-identify --band 10,1000 --rms 0.1 --plot`\nand `plantbus-control iff --live --rms 0.02 --plot` (the amplifier saturates at −20 V: a rms of 1 is too much at the resonance).\n'

printf '\n## Actuator (2)\n\n### Selection, Table 2.1 (`plantbus-actuator select`)\n'
selection
printf '\nThe report chooses the APA300ML; read strictly it exceeds "resolution < 2 nm" with 3 nm and "stiffness ≈ 1 N/µm" with 1.8.\n'

printf '\n### APA300ML as an element (`plantbus-actuator characterize`)\n'
head_row
row '2.3' 'axial stiffness' 1.75 'N/µm' 1e-6 actuator /stiffness 'data sheet 1.8'
row '2.3' 'first axial mode, bottom fixed' 709 'Hz' 1 actuator /resonance 'data sheet 650 … 840'
row '2.3' 'amplification' 5 '' 1 actuator /amplification
row '2.3, Table 2.1' 'stroke' 304 'µm' 1e6 actuator /stroke '3 stacks of 20 µm'
row '2.2' 'mass' 115 'g' 1e3 actuator /mass
row 'fig. 2.3' 'compliance' '' '' 1 none none 'one over the stiffness, then the resonance: `plantbus-actuator characterize config/elements/apa300ml.mat --plot`'

printf '\n### 2-DoF model tuned to it, 5 kg (`plantbus-actuator fit`)\n'
head_row
row 'Table 2.2' 'k_1' 0.30 'N/µm' 1e-6 fit /parameters/k_1
row 'Table 2.2' 'k_e' 4.3 'N/µm' 1e-6 fit /parameters/k_e
row 'Table 2.2' 'k_a' 2.15 'N/µm' 1e-6 fit /parameters/k_a
row 'Table 2.2' 'g_a' 2.7 'N/V' 1 fit /parameters/g_a
row 'Table 2.2' 'g_s' 0.53 'V/µm' 1e-6 fit /parameters/g_s
row 'Table 2.2' 'c_1' 18 'Ns/m' 1 fit /parameters/c_1 "$damping"
row 'Table 2.2' 'c_e' 0.7 'Ns/m' 1 fit /parameters/c_e 'as c_1'
row 'Table 2.2' 'c_a' 0.35 'Ns/m' 1 fit /parameters/c_a 'as c_1'
row 'fig. 2.5' 'V_a → y matches to' '' 'Hz' 1 fit /match/y/end_hz '`plantbus-actuator fit config/elements/apa300ml.mat --plot`'
row 'fig. 2.5' 'first pole of V_a → y, element' '' 'Hz' 1 fit /landmarks/pole_hz
row 'fig. 2.5' 'first zero of V_a → V_s, element' '' 'Hz' 1 fit /landmarks/zero_hz
row 'fig. 2.5' 'pole, model of Table 2.2' '' 'Hz' 1 modes /modes_hz/0 '`config/plants/apa300ml-bench.json`'
row 'fig. 2.5' 'zero, model of Table 2.2' '' 'Hz' 1 zeros /zeros_hz/0
row 'fig. 2.5' 'y/V_a at 0 Hz, model of Table 2.2' '' 'µm/V' 1e6 bench /dc_gain/1/0
row 'fig. 2.5' 'V_s/V_a at 0 Hz, model of Table 2.2' '' 'V/V' 1 bench /dc_gain/0/0

printf '\n### Electrical boundary of the sensor stack (`plantbus-actuator boundary`)\n'
head_row
row '2.5, fig. 2.6' 'resonance, short-circuited' '' 'Hz' 1 boundary /boundaries/0/resonance_hz
row '2.5, fig. 2.6' 'resonance, open' '' 'Hz' 1 boundary /boundaries/1/resonance_hz
row '2.5, fig. 2.6' 'shift of the open stack' '' '%' 1 boundary /boundaries/1/shift_percent 'small, as in the report; k33 of Table 1.4'

printf '\n### Hexapod with 2-DoF and with element struts, fig. 2.7 (`plantbus-study actuator-model`)\n'
study_table struts strut 'states;states;1' 'first mode [Hz];mode_hz/0;1' 'sixth [Hz];mode_hz/5;1' \
  'IFF zero [Hz];iff_zero_hz;1' 'attainable damping, least [%];smallest_attainable_damping;100' \
  'RGA number with IFF;rga_number_damped;1'
printf '\nThe 2-DoF model stands for the element, as the report finds. Plots: add `--plot`.\n'

printf '\n## Flexible joints (3)\n\n### Table 3.1 (`plantbus-joint characterize`)\n'
head_row
row 'Table 3.1' 'axial k_a' 94 'N/µm' 1e-6 joint /stiffness/z 'wanted > 100: a miss in both'
row 'Table 3.1' 'shear k_s' 12.7 'N/µm' 1e-6 joint /stiffness/x 'wanted > 1'
row 'Table 3.1' 'bending k_f' 4.83 'Nm/rad' 1 joint /stiffness/rx 'wanted < 100'
row 'Table 3.1' 'torsion k_t' 260 'Nm/rad' 1 joint /stiffness/rz 'wanted < 500'
row 'Table 3.1' 'margin of k_a' -6 '%' 100 joint /limits/axial_stiffness/margin 'the difference is of the margin: 94 of 100 against 94.9'

printf '\n### Forces along the struts: k_r ≪ k·l² (3.2)\n'
head_row
row '3.2' 'k l², k = 1 N/µm, l = 95 mm' 9000 'Nm/rad' 1 higher /values/0/struts/limit 'the template with its top joints higher'
row '3.2' 'k l², k = 10⁴ N/m, l = 95 mm' 90 'Nm/rad' 1 higher /values/1/struts/limit
row '3.2' 'k l², k = 1 N/µm, l of the template' '' 'Nm/rad' 1 length /values/0/struts/limit 'l = 82.5 mm'
row '3.2' 'k l² / k_r of the shipped hexapod' '' '' 1 struts /values/0/struts/margin 'k = 1.73 N/µm, k_r = 4.83 Nm/rad'

printf '\n### Bending stiffness, struts of one degree of freedom, fig. 3.2, 3.3 (`plantbus-study bending`)\n'
study_table bending1 'k_f [Nm/rad]' 'IFF zero [Hz];iff_zero_hz;1' 'first mode [Hz];mode_hz/0;1' \
  'attainable, least [%];smallest_attainable_damping;100' 'one gain, least [%];best/smallest_damping;100'
printf '\nWithout stiffness in parallel ideal joints leave no zero; bending makes it, and it limits IFF.\n\nThe same with the 2-DoF actuator:\n'
study_table bending2 'k_f [Nm/rad]' 'IFF zero [Hz];iff_zero_hz;1' 'first mode [Hz];mode_hz/0;1' \
  'attainable, least [%];smallest_attainable_damping;100' 'one gain, least [%];best/smallest_damping;100'
printf '\nThe shell is in parallel already: up to 100 Nm/rad bending hardly matters.\n'

printf '\n### Axial stiffness, fig. 3.4, 3.5 (`plantbus-study axial`)\n'
study_table axial 'k_a [N/m]' 'IFF zero [Hz];iff_zero_hz;1' 'mode 1 [%];attainable_damping/0;100' \
  'mode 3 [%];attainable_damping/2;100' 'mode 6 [%];attainable_damping/5;100' \
  'RGA number with IFF;rga_number_damped;1'
printf '\n100 N/µm is enough: the attainable damping is within 3 %% of that with rigid joints.\n'

printf '\n### Models of the joints, fig. 3.8, section 3.5 (`plantbus-study joint-model`)\n'
head_row
row '2.6' 'states, 2-DoF struts, ideal joints' 24 '' 1 joints /values/0/states
row '3.5' 'states, joints with k_f, k_t, k_a' 48 '' 1 joints /values/2/states
row '3.5' 'states, joints as elements' 252 '' 1 joints /values/3/states
study_table joints joints 'states;states;1' 'first mode [Hz];mode_hz/0;1' 'sixth [Hz];mode_hz/5;1' \
  'IFF zero [Hz];iff_zero_hz;1' 'attainable, least [%];smallest_attainable_damping;100'

cat <<'TEXT'

## Where it differs, and why
- Elements: the shipped ones are meshed by `plantbus-part` from dimensions and handbook materials (config/parts); stiffnesses and
  modes are within 1 % of the report's, whose elements came from another mesh and program.
- The APA95ML is a model to its data sheet, not the maker's drawing. The delays of the bench (one sample on V_s, two on y) are in
  its plant file; they lead the suspension mode up in frequency at high gain, where it would reach the real axis without them.
- The capacitance of Table 1.3 and the ε^T of Table 1.4 do not belong together: a layer of 125 µm with the latter has more.
- Dampers of the 2-DoF model follow the damping given to the element, which no geometry tells.
- Root loci are of the loop as sampled at 10 kHz, with the controller of eq. 1.4 (integrator at 2 Hz, high-pass at 0.5 Hz); the
  report draws them in continuous time. With struts of one degree of freedom the corners limit the damping where ideal joints
  would leave no limit.
- Joints with stiffness and no damping leave modes of the struts undamped, which a sampled controller can make unstable at high gain:
  `plantbus-study` tells that gain in a column of its own.
- Actuators: the report chooses the APA300ML by weighing; `plantbus-actuator select` holds each number against its limit.
TEXT
}

document >"$work/report.md"
mv "$work/report.md" "$out"
echo "wrote $out" >&2
