# All the work is done by bootstrap.py, which runs without make too: python bootstrap.py reproduce
.DEFAULT_GOAL := help
COMMANDS := setup reproduce test test-opencv4 test-nbgrader test-browser bench same data handout lab explore site lint format pins clean

# The first Python that is new enough and can make environments; else the first that runs at all, which then
# says what it lacks. PYTHON=... on the command line is taken as it is.
PROBE := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))
CANDIDATES := python3.13 python3.12 python3.11 python3.14 python3 python

.PHONY: help $(COMMANDS)
help $(COMMANDS):
	@py="$(PYTHON)"; \
	if [ -n "$$py" ] && ! $$py -c 'pass' >/dev/null 2>&1; then \
	    echo "stereolib: PYTHON=$$py does not run. Name a Python 3.11 or newer, or leave PYTHON away." >&2; exit 2; fi; \
	for p in $(CANDIDATES); do [ -n "$$py" ] && break; $$p -c '$(PROBE)' >/dev/null 2>&1 && py=$$p; done; \
	for p in $(CANDIDATES); do [ -n "$$py" ] && break; $$p -c 'f"{1}"' >/dev/null 2>&1 && py=$$p; done; \
	if [ -z "$$py" ]; then echo "stereolib: no Python found. Install Python 3.11 or newer, then run make again." >&2; exit 2; fi; \
	$$py bootstrap.py $@ $(ARGS)
