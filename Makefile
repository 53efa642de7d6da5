# make demo and make test set up everything they need, and do it once.
PYTHON := $(shell for p in python3.11 python3.12 python3.13 python3; do \
  $$p -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' \
  >/dev/null 2>&1 && echo $$p && break; done)
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
INTERFACES := $(VENV)/.interfaces
export OPENBLAS_NUM_THREADS = 1
export ROS_AUTOMATIC_DISCOVERY_RANGE = LOCALHOST

CORES = tests/push_model tests/push_scenario tests/push_estimation tests/push_planner tests/push_mpc \
  tests/push_supervisor tests/push_bringup tests/planar_push tests/push_record \
  tests/grasp_opt tests/swarm_push

.PHONY: docs pictures benchpush gco relopush install demo test test-long test-studies test-fast coverage lint clean
install: $(STAMP)

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11, 3.12 or 3.13 with venv is needed; set PYTHON=..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --upgrade "pip==25.2"

# The interfaces are wheels of their own. tf2_msgs is built only where no ROS brings it.
$(INTERFACES): $(VENV)/bin/python constraints.txt $(shell find push_msgs tf2_msgs -type f)
	@echo "building the message packages (about a minute)"
	$(BIN)/python -m pip install -q -c constraints.txt "ros-jazzy-rclpy[fastrtps]" ros-jazzy-common-interfaces
	$(BIN)/python -m pip install -q --force-reinstall --no-deps ./push_msgs
	$(BIN)/python -I -c "import tf2_msgs.msg" 2>/dev/null || \
	  $(BIN)/python -m pip install -q --no-deps ./tf2_msgs
	@touch $@

$(STAMP): $(INTERFACES) pyproject.toml constraints.txt
	@echo "installing the suite (a minute; three more where PyBullet must be compiled)"
	$(BIN)/python -m pip install -q "setuptools==80.9.0" "wheel==0.45.1" -c constraints.txt "numpy>=2,<2.5"
	$(BIN)/python -m pip install -q -c constraints.txt --no-build-isolation -e ".[dev]"
	$(BIN)/planar-push warm-up
	@touch $@

demo: $(STAMP)
	$(BIN)/planar-push demo --out results/demo

# What starts processes in real time runs alone; the rest side by side, each in its own domain; nodes
# wait for each other now and then, so there are more workers than cores.
test: lint
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "not live and not long and not study"
	$(BIN)/python -m pytest -m "live and not long"

# Slow tests: whole jobs in PyBullet, seeded samples of the studies, faults in real time.
test-long: $(STAMP)
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "long and not live"
	$(BIN)/python -m pytest -m "long and live"

# Whole samples of claims, e.g. hundreds of random problems: more than an hour on two cores.
test-studies: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m study

# The cores: no nodes, no simulation of whole jobs.
test-fast: $(STAMP)
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "not live and not long and not study" --durations=5 $(CORES)

coverage: $(STAMP)
	$(BIN)/python -m pytest -n 2 -m "not live and not study" --durations=0 --cov --cov-branch --cov-report=term

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .
	$(BIN)/mypy

# The pages of docs as a site, with an API reference; needs no network.
docs: $(STAMP)
	$(BIN)/python -m sphinx -q -W -b html docs build/docs
	@echo "build/docs/index.html"

# The pictures of README and docs that show one run each.
pictures: $(STAMP)
	$(BIN)/python -m tests.pictures

# Rooms of Bench-Push for the studies bench-push and box-delivery; its packages exclude versions of ours.
# benchnpin asks for PyTorch and more, which these rooms do not use.
BENCHPUSH := .venv-benchpush
benchpush: $(VENV)/bin/python
	$(BIN)/python -m venv $(BENCHPUSH)
	$(BENCHPUSH)/bin/python -m pip install -q -r push_study/bench_push/requirements.txt
	$(BENCHPUSH)/bin/python -m pip install -q --no-deps benchnpin==0.1.1
	$(BENCHPUSH)/bin/python -c "import benchnpin.environments.area_clearing"

# GCo for the study gco: the program of its authors with their trained model, as of one revision.
GCO := .venv-gco
GCO_SOURCE ?= https://github.com/yoraish/gco
gco: $(VENV)/bin/python
	rm -rf $(GCO)
	$(BIN)/python -m venv $(GCO)
	$(GCO)/bin/python -m pip install -q -r push_study/gco/requirements.txt
	git clone -q --no-checkout $(GCO_SOURCE) $(GCO)/gco
	git -C $(GCO)/gco checkout -q afc27db -- LICENSE data flow_matching gco gco-cpp
	$(GCO)/bin/python -m pip install -q --no-deps --no-build-isolation -e $(GCO)/gco/flow_matching -e $(GCO)/gco/gco
	$(GCO)/bin/python -m pip install -q --no-deps --no-build-isolation $(GCO)/gco/gco-cpp
	$(GCO)/bin/python -c "import gcocpp, gco, mujoco"

# ReloPush for the study relopush: the planner of its authors, compiled as of one revision, without ROS 1. It needs a
# C++ compiler and the headers of Boost, Eigen and OMPL (Debian, Ubuntu: pkg-config libboost-graph-dev libeigen3-dev libompl-dev).
RELOPUSH := .relopush
RELOPUSH_SOURCE ?= https://github.com/fluentrobotics/ReloPush
ROS1 := ros/ros std_msgs/Float32 std_msgs/String nav_msgs/Path geometry_msgs/PoseStamped \
  geometry_msgs/PoseWithCovarianceStamped geometry_msgs/TransformStamped visualization_msgs/Marker \
  visualization_msgs/MarkerArray tf/tf tf/transform_listener tf_conversions/tf_eigen eigen_conversions/eigen_msg
RELOPUSH_PARTS := graph_info edge_construction dijkstra_tools reloPush/movableObject reloPush/color_print \
  reloPush/parse_testdata reloPush/params reloPush/push_pose_tools reloPush/data_collector reloPush/hexNfloat \
  omplTools/fromOMPL omplTools/dubins_tools pathPlanTools/tf_tools pathPlanTools/path_planning_tools
relopush:
	rm -rf $(RELOPUSH)
	git clone -q --no-checkout $(RELOPUSH_SOURCE) $(RELOPUSH)/relopush
	git -C $(RELOPUSH)/relopush checkout -q 05e17ca -- LICENSE include src testdata
	@sed 's|@PROJECT_NAME@|reloPush|; s|@CMAKE_CURRENT_SOURCE_DIR@|.|' $(RELOPUSH)/relopush/include/config.h.in > $(RELOPUSH)/relopush/include/config.h
	@for h in $(ROS1); do mkdir -p $(RELOPUSH)/ros1/$${h%/*} && echo '#include "ros1.h"' > $(RELOPUSH)/ros1/$$h.h; done
	@cd $(RELOPUSH)/relopush && $(CXX) -std=c++17 -O2 -w -DBOOST_ALLOW_DEPRECATED_HEADERS $$(pkg-config --cflags ompl eigen3) -I ../../push_study/relopush \
	  -I ../ros1 -I . -I include -I src/pathPlanTools ../../push_study/relopush/plan.cpp $(RELOPUSH_PARTS:%=src/%.cpp) -lompl -o ../plan

clean:
	rm -rf $(VENV) $(BENCHPUSH) $(GCO) $(RELOPUSH) results build *.egg-info
