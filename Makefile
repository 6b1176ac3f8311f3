# Arris: build, test, demo, bench, install. All output goes under $(B).
#
#   make            build/arris and its plugins; a second one does nothing
#   make demo       install what is missing, build, measure the box, show the result
#   make cell       a simulated robot, camera, pipeline and subscribers over LCM, for a minute
#   make test       install what is missing, build, run every test
#   make check      the tests under ASan and UBSan, TSan, valgrind; a minute of each fuzzer
#   make test-vm    the drivers against a real kernel in a virtual machine
#   make test-vm-cycles    there, opened and closed 200 times, under ASan and UBSan, and TSan
#   make bench      speed and accuracy beside others, in one run
#   make experiments   the thesis's comparisons of detectors and of settings, with figures
#   make lint       format, headers alone, shell scripts        make format  put the format right
#   make install    PREFIX=/usr/local, DESTDIR=                 make uninstall

B       ?= build
PREFIX  ?= /usr/local
LIBDIR  ?= $(PREFIX)/lib
OPT     ?= -O2 -g
# The first one only: the makes below take part in its jobs.
ifeq ($(MAKELEVEL)$(filter -j%,$(MAKEFLAGS)),0)
MAKEFLAGS += -j$(shell nproc)
endif
VERSION := 0.1.0

WARN    := -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Werror
san     := $(SAN:%=-fsanitize=% -fno-omit-frame-pointer)
base     = $(OPT) $(WARN) -fPIC -fvisibility=hidden -ffp-contract=off -MMD -MP $(san) \
           -Icore -Iplugins -Idrivers -Iplugins/common -I$(B) -DARRIS_VERSION=\"$(VERSION)\"
cflags   = -std=c11 -D_GNU_SOURCE -Wstrict-prototypes $(base) $(CFLAGS)
cxxflags = -std=c++17 $(base) $(CXXFLAGS)
ldflags  = $(san) $(LDFLAGS)

core_src   := $(sort $(wildcard core/*.c))
cli_src    := core/cli/main.c core/cli/launch.c core/cli/stages.c
common_src := $(sort $(wildcard plugins/common/*.c))
plugins    := $(filter-out common,$(notdir $(patsubst %/,%,$(sort $(wildcard plugins/*/) \
              $(dir $(wildcard drivers/*/plugin.mk))))))
types      := $(sort $(wildcard plugins/lcm/types/*.lcm))
types_c    := $(patsubst plugins/lcm/types/%.lcm,$(B)/lcmtypes/arris_%.c,$(types))
headers    := core/arris.h core/arris_plugin.h core/arris_geometry.h core/arris_types.h

.PHONY: all demo cell test check test-vm test-vm-cycles bench experiments lint format install uninstall clean setup-% \
        lcmtypes-python run-experiments run-tests run-vm run-vm-cycles vm-cycles run-valgrind run-fuzz fuzzers
.DELETE_ON_ERROR:
.SECONDARY:
all: $(B)/arris $(B)/arris-robot $(plugins:%=$(B)/lib/arris/%.stages)

# What each plugin and test needs beyond core: NAME_PKGS (pkg-config), NAME_CFLAGS, NAME_LIBS, and
# NAME_uses: the plugins whose objects it is linked with as well.
include $(wildcard plugins/*/plugin.mk drivers/*/plugin.mk) tests/tests.mk
common_PKGS := jansson
robot_PKGS  := lcm

obj         = $(patsubst %,$(B)/obj/%.o,$(1))
plugin_obj  = $(call obj,$(sort $(wildcard $(foreach d,plugins drivers,$(d)/$(1)/*.c $(d)/$(1)/*.cc))))
kernel_obj  = $(filter-out %/plugin.c.o %/main.c.o,$(plugin_obj))
used_obj    = $(foreach p,$($(1)_uses),$(call kernel_obj,$(p)))
pkg_cflags  = $(if $($(1)_PKGS),$(shell pkg-config --cflags $($(1)_PKGS))) $($(1)_CFLAGS)
pkg_libs    = $(if $($(1)_PKGS),$(shell pkg-config --libs $($(1)_PKGS))) $($(1)_LIBS)
used_libs   = $(foreach p,$(1) $($(1)_uses),$(call pkg_libs,$(p)))
owner       = $(if $(filter plugins/% drivers/%,$(1)),$(word 2,$(subst /, ,$(1))),$(notdir $(1)))

# V=1 shows every command whole.
Q  := $(if $(V),,@)
say = $(if $(V),@:,@echo '$(1)  $(2)')

# ---- objects and programs --------------------------------------------------------------------

$(B)/obj/%.c.o: %.c Makefile | $(B)/packages $(types_c)
	@mkdir -p $(@D)
	$(call say,CC,$<)
	$(Q)$(CC) $(cflags) $(call pkg_cflags,$(call owner,$*)) -c -o $@ $<
$(B)/obj/%.cc.o: %.cc Makefile | $(B)/packages $(types_c)
	@mkdir -p $(@D)
	$(call say,CXX,$<)
	$(Q)$(CXX) $(cxxflags) $(call pkg_cflags,$(call owner,$*)) -c -o $@ $<

# Of the LCM types lcm-gen makes C; and Python with `make lcmtypes-python`.
$(B)/lcmtypes/arris_%.c $(B)/lcmtypes/arris_%.h: plugins/lcm/types/%.lcm | $(B)/packages
	@mkdir -p $(@D)
	$(call say,GEN,$@)
	$(Q)lcm-gen -c --c-cpath $(@D) --c-hpath $(@D) --cinclude lcmtypes $<
$(types_c:%=%.o): %.c.o: %.c | $(types_c)
	$(call say,CC,$<)
	$(Q)$(CC) $(cflags) -w -fno-sanitize=undefined -c -o $@ $<
lcmtypes-python: $(types) | $(B)/packages
	@mkdir -p $(B)/python
	$(Q)lcm-gen -p --ppath $(B)/python $(types)

# Names what is missing before a compiler stumbles over it.
pkgs := $(sort $(common_PKGS) $(foreach p,$(plugins),$($(p)_PKGS)))
$(B)/packages: $(wildcard plugins/*/plugin.mk drivers/*/plugin.mk)
	@mkdir -p $(@D)
	@for p in $(pkgs); do pkg-config --exists $$p || { \
	    echo "make: the library $$p is missing; 'make setup-build' installs what the build needs" >&2; \
	    exit 1; }; done
	@for h in suitesparse/cholmod.h eigen3/Eigen/SparseCholesky; do \
	    echo "#include <$$h>" | $(CXX) -E -x c++ - > /dev/null 2>&1 || { \
	    echo "make: $$h is missing (libsuitesparse-dev, libeigen3-dev); 'make setup-build' installs" \
	        "what the build needs" >&2; exit 1; }; done
	@command -v lcm-gen > /dev/null || { \
	    echo "make: lcm-gen is missing; 'make setup-build' installs what the build needs" >&2; exit 1; }
	@touch $@

$(B)/lib/libarris.so.1: $(call obj,$(core_src))
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -shared -Wl,-soname,libarris.so.1 -o $@ $^ $(ldflags) -lm -lpthread -ldl
	@ln -sf libarris.so.1 $(B)/lib/libarris.so
$(B)/libarris.a: $(call obj,$(core_src))
	$(call say,AR,$@)
	$(Q)rm -f $@; $(AR) rcs $@ $^
$(B)/common.a: $(call obj,$(common_src)) $(types_c:%=%.o)
	$(call say,AR,$@)
	$(Q)rm -f $@; $(AR) rcs $@ $^
$(B)/arris: $(call obj,$(cli_src)) $(B)/lib/libarris.so.1
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -Wl,-rpath,'$$ORIGIN/lib:$$ORIGIN/../lib'
$(B)/arris-robot: $(call obj,$(sort $(wildcard drivers/robot/*.c))) $(B)/common.a $(B)/lib/libarris.so.1
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -Wl,-rpath,'$$ORIGIN/lib:$$ORIGIN/../lib' $(call pkg_libs,robot) -lm
$(B)/mklist: $(call obj,core/cli/mklist.c)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -ldl

.SECONDEXPANSION:
$(B)/lib/arris/%.so: $$(call plugin_obj,$$*) $$(call used_obj,$$*) $(B)/common.a $(B)/lib/libarris.so.1
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CXX) -shared -o $@ $(filter %.o %.a,$^) -L$(B)/lib -larris $(ldflags) -Wl,-z,defs -Wl,-rpath,'$$ORIGIN/..' \
	    -Wl,--exclude-libs,ALL $(call used_libs,$*) $(call pkg_libs,common) -lm
$(B)/lib/arris/%.stages: $(B)/lib/arris/%.so $(B)/mklist
	$(call say,MAKE,$@)
	$(Q)$(B)/mklist $< > $@

# ---- set-up: installs the Debian packages that are missing, and says which --------------------

packages_build := gcc g++ pkg-config libpng-dev libturbojpeg0-dev libjansson-dev libmd-dev \
                  libassimp-dev liblcm-dev liblcm-bin libeigen3-dev libsuitesparse-dev libusb-1.0-0-dev \
                  libopencv-core-dev libopencv-imgproc-dev libopencv-calib3d-dev \
                  libopencv-video-dev
packages_test  := $(packages_build) libcmocka-dev iproute2 python3-venv
packages_cell  := $(packages_build) iproute2 util-linux
packages_check := $(packages_test) clang libclang-rt-14-dev valgrind
packages_bench := $(packages_test) libgstreamer1.0-dev libopencv-contrib-dev libceres-dev
packages_lint  := $(packages_build) clang-format shellcheck

setup-%:
	@missing=; for p in $(packages_$*); do \
	    dpkg-query -W -f '$${Status}\n' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
	if [ -n "$$missing" ]; then \
	    echo "installing:$$missing"; \
	    [ "$$(id -u)" = 0 ] || sudo=sudo; \
	    $$sudo apt-get update -q && \
	    $$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $$missing; \
	fi

# The libraries are looked for when make starts, so what comes after a set-up is a make of its own.
demo: setup-build
	@$(MAKE) --no-print-directory all $(B)/report
	@mkdir -p $(B)/demo && cd $(B)/demo && ../arris launch $(CURDIR)/samples/box/box.arris
	@$(B)/report $(B)/demo/lines.json samples/box/truth.json
	@echo "views: $(B)/demo/lines.svg"
test: setup-test
	@$(MAKE) --no-print-directory run-tests
$(B)/report: $(call obj,samples/box/report.c)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -ljansson -lm

# ---- samples that speak over LCM: subscriber, cell ---------------------------------------------

cell: setup-cell
	@$(MAKE) --no-print-directory all $(B)/subscriber $(B)/cell-watch
	@B=$(B) samples/cell/run.sh $(CELL_SECONDS)
CELL_SECONDS ?= 60
$(B)/subscriber: $(call obj,samples/subscriber/subscriber.c) $(B)/common.a
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -llcm
$(B)/cell-watch: $(call obj,samples/cell/watch.c) $(B)/common.a $(B)/lib/libarris.so.1
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -Wl,-rpath,'$$ORIGIN/lib' -llcm -lm

# ---- tests: one program a module, linked with the plugin of its name --------------------------

tests      := $(filter-out $(if $(SAN),$(slow_tests)),$(sort $(patsubst tests/test_%.c,%,$(wildcard tests/test_*.c))))
test_parts  = $(1) $(sort $($(1)_uses) $(test_$(1)_uses))
$(B)/tests/test_%: $$(call obj,tests/test_$$*.c) \
        $$(foreach p,$$(call test_parts,$$*),$$(call kernel_obj,$$p)) $(B)/common.a $(B)/libarris.a
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CXX) -o $@ $^ $(ldflags) $(foreach p,$(call test_parts,$*) test_$*,$(call pkg_libs,$(p))) \
	    $(call pkg_libs,common) -lcmocka -lm -lpthread -ldl

# Python's lcm, the foreign subscriber; without it (pip needs the net) its test says that it is skipped.
test-parts: $(B)/subscriber $(B)/cell-watch $(B)/venv/lcm lcmtypes-python
$(B)/venv/lcm:
	@mkdir -p $(@D)
	@python3 -m venv $(@D) && $(@D)/bin/pip install -q lcm==1.5.3 && touch $@ || echo "no Python lcm"

# Each writes its output whole when it ends, since several run at once.
run-tests: all test-parts $(tests:%=$(B)/tests/test_%)
	@rm -f $(B)/tests/*.passed
	@$(MAKE) --no-print-directory -k -O $(tests:%=run-test-%); failed=$$?; \
	    echo "$$(ls $(B)/tests/*.passed 2>/dev/null | wc -l) of $(words $(tests)) test programs passed"; exit $$failed
run-test-%:
	@echo "== $*"; B=$(B) $(B)/tests/test_$* && touch $(B)/tests/$*.passed

check: setup-check
	$(MAKE) run-tests B=$(B)/asan SAN=address,undefined LDFLAGS='$(LDFLAGS) -fno-sanitize-recover=all'
	TSAN_OPTIONS=halt_on_error=1:suppressions=$(CURDIR)/tests/tsan.supp $(MAKE) run-tests B=$(B)/tsan SAN=thread
	$(MAKE) run-valgrind
	$(MAKE) run-fuzz
# Of a test all, or those whose names match: the others would take minutes there.
run-valgrind: all $(foreach t,$(valgrind_tests),$(B)/tests/test_$(firstword $(subst :, ,$(t))))
	for t in $(valgrind_tests); do B=$(B) valgrind -q --error-exitcode=9 --leak-check=full \
	    --suppressions=tests/valgrind.supp $(B)/tests/test_$${t%%:*} "$${t#*:}" || exit 1; done

# ---- the drivers in a virtual machine, tests/vm --------------------------------------------------

include tests/vm/vm.mk

# ---- fuzzing: libFuzzer, each for FUZZ_SECONDS -------------------------------------------------

FUZZ_SECONDS ?= 60
fuzzers := $(sort $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c)))
run-fuzz:
	$(MAKE) fuzzers B=$(B)/fuzz CC=clang CXX=clang++ SAN=fuzzer-no-link,address,undefined
	for f in $(fuzzers); do mkdir -p $(B)/fuzz/corpus/$$f; echo $$f; done | \
	    xargs -P 2 -I{} sh -c '$(B)/fuzz/fuzz_{} -max_total_time=$(FUZZ_SECONDS) -timeout=10 -rss_limit_mb=3000 \
	    -artifact_prefix=$(B)/fuzz/{}- $(B)/fuzz/corpus/{} $$(ls -d tests/fuzz/seeds/{} 2>/dev/null) \
	    > $(B)/fuzz/{}.log 2>&1 || { tail -30 $(B)/fuzz/{}.log; exit 255; }; tail -1 $(B)/fuzz/{}.log'
fuzzers: $(fuzzers:%=$(B)/fuzz_%)
$(B)/fuzz_%: $$(call obj,tests/fuzz/fuzz_$$*.c) \
        $$(call used_obj,fuzz_$$*) $(B)/common.a $(B)/libarris.a
	$(call say,MAKE,$@)
	$(Q)$(CXX) -fsanitize=fuzzer,address,undefined -o $@ $^ \
	    $(call used_libs,fuzz_$*) $(call pkg_libs,common) -lm -lpthread -ldl

# ---- bench ------------------------------------------------------------------------------------

benches := $(sort $(basename $(notdir $(wildcard tests/bench/bench_*.c tests/bench/bench_*.cc))))
bench: setup-bench
	@$(MAKE) --no-print-directory run-benches
run-benches: all $(benches:%=$(B)/bench/%)
	@for b in $(benches); do echo "== $$b"; $(B)/bench/$$b || exit 1; done
$(B)/bench/%: $$(call obj,$$(wildcard tests/bench/$$*.c tests/bench/$$*.cc)) \
        $$(call used_obj,$$*) $(B)/common.a $(B)/libarris.a
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CXX) -o $@ $^ $(ldflags) $(call used_libs,$*) $(call pkg_libs,common) -lm -lpthread -ldl

# ---- experiments: figures and tables of the thesis's, samples/experiments ----------------------

experiments: setup-build
	@$(MAKE) --no-print-directory run-experiments
run-experiments: all $(B)/experiments/experiments.so
	@B=$(B) samples/experiments/features/run.sh
	@echo; B=$(B) samples/experiments/tuning/run.sh
	@echo; $(MAKE) --no-print-directory chapter3
$(B)/experiments/experiments.so: \
        $(call obj,$(wildcard $(addprefix samples/experiments/,*.c features/*.c tuning/*.c))) \
        $(B)/lib/libarris.so.1
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -shared -o $@ $(filter %.o,$^) -L$(B)/lib -larris $(ldflags) -Wl,-rpath,'$$ORIGIN/../lib' -lpng -lm
include samples/experiments/experiments.mk

# ---- install ----------------------------------------------------------------------------------

install: all
	install -d $(addprefix $(DESTDIR),$(PREFIX)/bin $(LIBDIR)/arris $(LIBDIR)/pkgconfig $(PREFIX)/include/arris)
	install $(B)/arris $(B)/arris-robot $(DESTDIR)$(PREFIX)/bin
	install $(B)/lib/libarris.so.1 $(DESTDIR)$(LIBDIR)
	ln -sf libarris.so.1 $(DESTDIR)$(LIBDIR)/libarris.so
	install -m 644 $(headers) $(DESTDIR)$(PREFIX)/include/arris
	install $(plugins:%=$(B)/lib/arris/%.so) $(DESTDIR)$(LIBDIR)/arris
	install -m 644 $(plugins:%=$(B)/lib/arris/%.stages) $(DESTDIR)$(LIBDIR)/arris
	sed 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@VERSION@|$(VERSION)|' core/arris.pc.in \
	    > $(DESTDIR)$(LIBDIR)/pkgconfig/arris.pc
	install -d $(DESTDIR)$(PREFIX)/lib/udev/rules.d
	install -m 644 drivers/usb/60-arris-usb.rules $(DESTDIR)$(PREFIX)/lib/udev/rules.d
uninstall:
	rm -f $(addprefix $(DESTDIR),$(addprefix $(PREFIX)/bin/,arris arris-robot) \
	    $(PREFIX)/lib/udev/rules.d/60-arris-usb.rules $(LIBDIR)/libarris.so.1 $(LIBDIR)/libarris.so \
	    $(LIBDIR)/pkgconfig/arris.pc $(plugins:%=$(LIBDIR)/arris/%.so) $(plugins:%=$(LIBDIR)/arris/%.stages) \
	    $(headers:core/%=$(PREFIX)/include/arris/%))
	-rmdir $(addprefix $(DESTDIR),$(LIBDIR)/arris $(PREFIX)/include/arris) 2>/dev/null

# ---- form -------------------------------------------------------------------------------------

sources = $(shell find core plugins $(wildcard drivers) tests samples \( -name '*.[ch]' -o -name '*.cc' \))
format: setup-lint
	clang-format -i $(sources)
# Of CHOLMOD nothing but functions of Core and Cholesky: the others are not under the LGPL.
cholmod_lgpl := cholmod_(start|finish|analyze_p|factorize|free_factor)
lint: setup-lint $(B)/lib/arris/adjust.so
	@! nm -D --undefined-only $(B)/lib/arris/adjust.so | grep -o 'cholmod_.*' | \
	    grep -vxE '$(cholmod_lgpl)' || { echo "make: adjust calls these, which are not known to be" \
	    "under the LGPL" >&2; exit 1; }
	clang-format --dry-run -Werror $(sources)
	for h in $(headers); do $(CC) -std=c11 -Wall -Wextra -Werror -fsyntax-only -x c $$h && \
	    $(CXX) -std=c++17 -Wall -Wextra -Werror -fsyntax-only -x c++ $$h || exit 1; done
	shellcheck $(shell git ls-files '*.sh' .ci/run)
clean:
	rm -rf $(B)

-include $(shell find $(B)/obj -name '*.d' 2>/dev/null)
