# `make run` and `make test` do all the set-up there is; the second start skips it.
PYTHON ?= python3
VENV := .venv/bin/python
ARGS ?=

.PHONY: run test bench report lint references clean

run:        ## open the window (without a display: the headless demo); ARGS="--scene interior" passes flags on
	@$(PYTHON) tools/setup.py run
	@$(VENV) app.py $(ARGS)

test: lint  ## lint, types, every test
	$(VENV) -m pytest -q -n auto --maxprocesses 4 --dist loadfile -m "not window"
	$(VENV) -m pytest -q -m window  # one after the other: they wait for windows and watch the clock

bench:      ## the measured table of the README
	@$(PYTHON) tools/setup.py run
	$(VENV) app.py bench --table $(ARGS)
	$(VENV) -m bench.features

report:     ## the same as a page with diagrams and pictures: out/bench.html; ARGS="--quick" for a look
	@$(PYTHON) tools/setup.py run
	$(VENV) app.py bench --html $(ARGS)

lint:
	@$(PYTHON) tools/setup.py test
	$(VENV) -m ruff check
	$(VENV) -m ruff format --check
	$(VENV) -m mypy

references: ## regenerate plans, screenshots and quality references: look at each before committing it
	@$(PYTHON) tools/setup.py test
	$(VENV) -m pytest tests/unit/test_plans.py tests/screenshots tests/quality --regenerate

clean:      ## everything made by running, but the environment (.venv)
	rm -rf out .cache .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
