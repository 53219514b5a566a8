# `make demo` and `make test` work on a fresh machine with Rust, a C compiler and Python 3: each sets up what is missing first.
.PHONY: demo docs test test-slow test-slurm on-slurm test-wheel test-windows sanitize wheel check bench fuzz study study-checker study-compare study-faults study-isolation study-refine study-refine-messy study-systems study-laws study-machines study-nmpc study-third-party study-thresholds study-rig-over-fmus study-programs study-sweep study-swing-up study-walker fmu portable windows setup setup-build clean
export CARGO_NET_RETRY ?= 10
# A build that happens once gains nothing from files for the next one; they cost a fifth of its time.
ifdef CI
export CARGO_INCREMENTAL ?= 0
endif

demo: fmu            ## replay a measured record through the coupled FMUs, then find what a declared model lacks
	cargo run --release --quiet -p airloop-cli -- run examples/01_run/system.ssd --measured data/rig/v05/trial_07.csv -o out/demo
	cargo run --release --quiet -p airloop-cli -- refine data/rig/v01 -o out/demo-refine

# One profile for checks, Rust tests and the program that the Python tests run: a second build of everything would cost
# as much as the tests. The FMUs are those of a release, but for the library that runs a whole system, most of which is in
# the program. The Python package has its tests in `make test-wheel`.
test: check          ## everything CI runs: checks, FMUs, Rust tests, FMI tests
	scripts/packager.sh dev --system-profile dev
	cargo test --workspace --exclude airloop-python
	AIRLOOP=target/debug/airloop .venv/bin/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile -m "not slow" tests/fmpy

test-slow: fmu       ## searches of minutes that `make test` leaves out
	scripts/setup.sh test
	AIRLOOP=target/release/airloop .venv/bin/python -m pytest -m slow -o faulthandler_timeout=3600 tests/fmpy

export AIRLOOP_WHEEL_PROFILE ?= release
wheel: setup-build   ## the Python package, with program and FMUs: out/wheel/airloop-*.whl
	rm -rf out/wheel
	scripts/packager.sh $(AIRLOOP_WHEEL_PROFILE) --system-profile $(AIRLOOP_WHEEL_PROFILE)
	.venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps -w out/wheel ./python

test-wheel: wheel    ## the wheel in a fresh environment, with its type stubs: python/tests
	python/test.sh out/wheel

test-slurm: fmu      ## a sweep on a Slurm cluster of three nodes on this computer, one of them killed; as root
	$(MAKE) --no-print-directory on-slurm

PROGRAM ?= target/release/airloop
on-slurm:            ## the same with a program that is built: PROGRAM=target/debug/airloop
	if [ "$$(id -u)" = 0 ] && ! command -v slurmd >/dev/null; then apt-get update -qq && apt-get install -y -qq slurmctld slurmd slurm-client munge || echo "Slurm cannot be installed here"; fi
	python3 tests/slurm/run.py $(PROGRAM)

TASKS ?= 10000       # trials of `make study-sweep`
study-sweep: fmu     ## trials in shards and on threads, sweeps killed at random and by dask, the cost of 1e3 to 1e6 tasks
	scripts/setup.sh study
	.venv/bin/python -m pip install --quiet --disable-pip-version-check 'dask[distributed]==2026.8.0'
	.venv/bin/python tests/study/sweep/dask_shards.py target/release/airloop
	python3 tests/study/sweep/trials.py target/release/airloop $(strip $(TASKS))
	python3 tests/study/sweep/kills.py target/release/airloop 20
	python3 tests/study/sweep/cost.py target/release/airloop

study-compare: fmu   ## the tables of docs/comparisons.md: FMPy, PySINDy, CasADi and SciPy on the same work
	scripts/setup.sh study
	.venv/bin/python -m pip install --quiet --disable-pip-version-check pysindy==2.0.0 scikit-learn==1.6.1
	.venv/bin/python tests/study/compare/fmpy_fit.py
	.venv/bin/python tests/study/compare/scipy_grey_box.py
	.venv/bin/python tests/study/compare/pysindy_terms.py
	.venv/bin/python tests/study/compare/casadi_swing_up.py

docs: wheel          ## the documentation site, notebooks executed, every link checked: out/site/index.html
	docs/site/build.sh out/wheel

check: setup         ## formatting, lints, documentation, generated files, licenses
	./check.sh

bench: fmu           ## cost of the master per FMU step
	cargo bench --workspace --bench "*"

SEED ?= 1
MINUTES ?= 10
fuzz: fmu            ## mutated files for every reader, MINUTES in all; inputs that made a fault: out/fuzz
	cargo run --release --quiet -p airloop-fuzz -- run --minutes $(strip $(MINUTES)) --seed $(strip $(SEED)) --keep out/fuzz

study: fmu           ## error of every master against its FMU steps: out/study/masters.csv, .svg
	scripts/setup.sh study
	.venv/bin/python tests/study/masters.py out/study

study-checker: setup ## FMUs with one defect each, by `airloop inspect --check` and by FMPy's validation: docs/checker.md
	AIRLOOP_MUTANTS=$(CURDIR)/out/checker cargo test --release -p airloop-fmi --test fmu_mutants -- --ignored --exact write_mutants
	.venv/bin/python tests/study/checker.py out/checker docs/checker.md

study-faults: fmu    ## a run killed a hundred times at random
	cargo test --release -p airloop-cli --test hostile_files -- --ignored --nocapture

study-isolation: fmu ## cost of worker processes compared with bare round trips, and 10,000 starts: out/study-isolation
	python3 tests/study/isolation.py target/release/airloop target/fmu/test/test-copy.fmu out/study-isolation

ONLY ?= .            # regular expression on the names of the cases: `make study-refine ONLY='^[rw]_'` takes minutes
study-refine: fmu    ## cases with known missing effects, and what `airloop refine` makes of them: out/study-refine
	scripts/setup.sh study
	.venv/bin/python tests/study/refine/make_cases.py out/study-refine/cases --seed $(strip $(SEED)) --only '$(strip $(ONLY))'
	.venv/bin/python tests/study/refine/score.py target/release/airloop out/study-refine/cases out/study-refine/reports --left --bound

SET ?=               # settings of the search: `make study-refine-messy SET='--set min_share_alone=0.4'`
study-refine-messy: fmu ## rigs that nothing fits to the noise, and controls: out/study-refine-messy
	scripts/setup.sh study
	.venv/bin/python tests/study/refine/make_messy.py out/study-refine-messy/cases --seed $(strip $(SEED)) --only '$(strip $(ONLY))'
	rm -rf out/study-refine-messy/reports
	printf '#!/bin/sh\nexec $(CURDIR)/target/release/airloop "$$@" $(strip $(SET))\n' > out/study-refine-messy/airloop
	chmod +x out/study-refine-messy/airloop
	.venv/bin/python tests/study/refine/score_messy.py out/study-refine-messy/airloop out/study-refine-messy/cases out/study-refine-messy/reports
	cargo test --release -p airloop-cli --test refine_messy -- --include-ignored

study-systems: fmu   ## pendulums, axes, seals and actuators with known truth, and what `airloop refine` makes of them: out/study-systems
	scripts/setup.sh study
	.venv/bin/python tests/study/systems/make_systems.py out/study-systems/sets
	.venv/bin/python tests/study/systems/score_systems.py target/release/airloop out/study-systems/sets out/study-systems/reports

N ?= 60              # cases with a law of `make study-laws`; a third as many nulls
study-laws: fmu      ## laws that no list holds, in six families, against PySINDy: out/study-laws
	scripts/setup.sh study
	.venv/bin/python -m pip install --quiet --disable-pip-version-check pysindy==2.0.0 scikit-learn==1.6.1
	rm -rf out/study-laws
	.venv/bin/python tests/study/laws/make_laws.py out/study-laws/cases --count $(strip $(N)) --seed $(strip $(SEED))
	.venv/bin/python tests/study/laws/score_laws.py target/release/airloop out/study-laws/cases out/study-laws/reports

study-machines: fmu  ## cubic springs, electronic oscillators, cascaded tanks and machines that lack nothing: out/study-machines
	scripts/setup.sh study
	rm -rf out/study-machines
	.venv/bin/python tests/study/laws/make_machines.py out/study-machines/cases --seed $(strip $(SEED)) --only '$(strip $(ONLY))'
	.venv/bin/python tests/study/laws/score_machines.py target/release/airloop out/study-machines/cases out/study-machines/reports

SAMPLE ?= 0          # so many cases of study-third-party, spread over systems and classes; 0: all
FLAVOR ?= study      # study: with attachments; plain: without
study-third-party: fmu   ## machines of other kinds as FMUs in C, and what `airloop refine` makes of them: out/study-third-party
	scripts/setup.sh study
	.venv/bin/python tests/study/third_party/make_third_party.py out/study-third-party/cases --seed $(strip $(SEED)) --only '$(strip $(ONLY))'
	.venv/bin/python tests/study/third_party/score_third_party.py target/release/airloop out/study-third-party/cases out/study-third-party/reports \
		--flavor $(strip $(FLAVOR)) --only '$(strip $(ONLY))' --sample $(strip $(SAMPLE))

study-thresholds: fmu ## settings of the search moved one at a time, effects missed against effects named wrongly: out/study-thresholds
	scripts/setup.sh study
	.venv/bin/python tests/study/refine/make_messy.py out/study-thresholds/cases --seed $(strip $(SEED)) --only '^(m_w_|m_r_|n_friction|n_actuator)'
	.venv/bin/python tests/study/refine/thresholds.py target/release/airloop out/study-thresholds/cases out/study-thresholds/reports

CASES ?= data/rig     # folders with a case.toml, of the rig of examples/01_run
study-rig-over-fmus: fmu ## the rig's coupled cases as studies over FMUs, and their own answers: out/study-rig-over-fmus
	.venv/bin/python tests/study/refine/rig_over_fmus.py target/release/airloop $(strip $(CASES)) out/study-rig-over-fmus --only '$(strip $(ONLY))'

study-nmpc: fmu      ## the swing-up with regulator and with model predictive control on perturbed rigs: out/study-nmpc/nmpc.md
	python3 tests/study/nmpc.py target/release/airloop out/study-nmpc

study-programs: fmu  ## 152 nonlinear and 37 quadratic programs against IPOPT, and perturbed starts: out/study-programs
	scripts/setup.sh study
	.venv/bin/python tests/study/programs/profile.py out/study-programs
	.venv/bin/python tests/study/programs/quadratic.py out/study-programs
	cargo bench --quiet -p airloop-plan --bench starts

study-swing-up: fmu  ## swing-up over the FMUs against CasADi with IPOPT, time and optimum: out/study/swing_up.csv
	scripts/setup.sh study
	.venv/bin/python tests/study/swing_up.py out/study

study-walker: fmu    ## compass-gait against MuJoCo and Drake; half a step against CasADi with IPOPT: out/study/walker.csv
	scripts/setup.sh study
	.venv/bin/python -m pip install --quiet --disable-pip-version-check mujoco==4.0.0 drake==1.51.1
	.venv/bin/python tests/study/walker_mujoco.py
	.venv/bin/python tests/study/walker_drake.py
	.venv/bin/python tests/study/walker_casadi.py out/study

fmu: setup-build     ## target/fmu/*.fmu, modelDescriptions/*.xml and the airloop binary
	scripts/packager.sh release
	cargo build --release -p airloop-cli

portable: setup-build ## the FMUs of `make fmu` with libraries that need no libgcc_s, by the linker of Zig
	scripts/portable.sh

windows: setup-build ## airloop.exe in target/windows and the FMUs of `make fmu` with Windows libraries in them, by mingw
	scripts/windows.sh

test-windows: fmu    ## airloop.exe under Wine: runs, checks of all FMUs and `refine` compared with Linux
	scripts/windows.sh
	python3 tests/windows/run.py target/windows target/release/airloop

sanitize: setup-build ## C parts and test FMUs under the sanitizers of the compiler, unit tests of the export under Miri
	scripts/sanitize.sh

setup:               ## .venv with all Python packages, .cargo/config.toml
	scripts/setup.sh test

setup-build:         ## only what a build needs
	scripts/setup.sh build

clean:               ## built files; the set-up stays
	cargo clean
	rm -rf out
