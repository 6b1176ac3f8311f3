#include "command.h"
int handeye_command(command *m, fault *f){(void)m;return fault_set(f,ARRIS_E_INTERNAL,NULL,"x");}
