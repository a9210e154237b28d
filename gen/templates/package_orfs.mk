# OpenROAD-flow-scripts: make DESIGN_CONFIG=<here>/config.mk PLATFORM=<platform>. Written for that flow, not run in it:
# utilisation and density are its usual ones. The times in constraint.sdc are in {{ unit_name }}; change them for a
# platform whose libraries count in another unit.
export DESIGN_NAME     = {{ module }}
export DESIGN_NICKNAME = lightloom_{{ module }}
PACKAGE := $(abspath $(dir $(lastword $(MAKEFILE_LIST)))/../../..)
export VERILOG_FILES   = $(PACKAGE)/rtl/{{ files | join(" $(PACKAGE)/rtl/") }}
export SDC_FILE        = $(PACKAGE)/flow/openroad/{{ module }}/constraint.sdc
export CORE_UTILIZATION ?= 50
export PLACE_DENSITY_LB_ADDON ?= 0.15
