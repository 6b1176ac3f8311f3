# The experiments of the thesis's chapter 3: each is one program, made from samples/experiments/NAME
# and what they share, which writes $(B)/experiments/NAME.svg and fails when its figure is bad.
#   make chapter3                      runs them all
#   make build/experiments/bin/noise   makes one; it runs from the repository's root
chapter3    := epipolar projection staircase translation baseline box parallel noise
exp_common  := $(sort $(wildcard samples/experiments/common/*.c))
exp_program := $(B)/experiments/bin/

.PHONY: chapter3
chapter3: all $(chapter3:%=$(exp_program)%)
	@failed=; for e in $(chapter3); do echo "== $$e"; B=$(B) $(exp_program)$$e || failed="$$failed $$e"; done; \
	[ -z "$$failed" ] || { echo "failed:$$failed"; exit 1; }
$(exp_program)%: $(B)/obj/samples/experiments/$$*/$$*.c.o $(call obj,$(exp_common)) $(B)/common.a $(B)/libarris.a
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -ljansson -lm -lpthread -ldl
