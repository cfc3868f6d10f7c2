/* The host's step over many rows, for a counter of instructions; case.h holds the case. */
#include "generated.c"
#include "case.h"
#include <stdlib.h>
#include <string.h>

int main(int count, char **arguments)
{
    const long rows = atol(arguments[count - 1]);
    double x[SIZE], x_old[SIZE];
    double *work = calloc((size_t)tff_work_reals(COUNT), sizeof *work);
    double *tension = calloc((size_t)(rows + 1) * (COUNT + 1), sizeof *tension);
    double *ends = calloc((size_t)(rows + 1) * 2, sizeof *ends);
    tff_weights chain;
    tff_report report;
    int worst;
    memset(&report, 0, sizeof report);
    memcpy(&chain, record, sizeof chain);
    memcpy(x, start, sizeof x);
    memcpy(x_old, start, sizeof x);
    chain.of_masses = of_masses;
    chain.run_end = run_end;
    return tff_run(&chain, STEP_S, (const tff_input *)inputs, rows, 1, PLACES x, x_old, work, tension, ends, 0, &report, &worst) != rows;
}
