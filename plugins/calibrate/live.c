#include "command.h"
int live_collect(command *m, fault *f){(void)m;return fault_set(f,ARRIS_E_INTERNAL,NULL,"x");}
