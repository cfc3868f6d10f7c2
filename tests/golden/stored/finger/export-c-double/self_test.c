/* Self test.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
/* self_test.c: calls the modules as the scripts of self_test_data.h say, and reports what differs from them. Fixed text.
 *
 * A script is a list of checks. Each has lines that are carried out in every row, in order: an input is given, a function is
 * called, an output is compared with numbers that the Python model computed. Three instances of a module are there, `slot`
 * is one of them. Exit status 0 when everything passes.
 */
#ifndef ARDUINO /* whose tools compile every file of a library */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "self_test_data.h"

#define TEST_BEFORE TEST_SLOTS /* the state before the last call */

static test_state test_states[TEST_SLOTS + 1];
static double test_answers[TEST_SLOTS + 1];
static tff_real test_inputs[TEST_INPUTS];
static double test_last[TEST_MEAN_OF]; /* differences */
static int test_kept;                  /* how many of them */
static uint32_t test_sum;
static int test_failures;

/* Of the check under way. */
static const test_check *test_now;
static const char *test_name;
static int test_failed;   /* lines */
static double test_worst; /* largest difference over what passes */
static double test_off;   /* that difference, */
static double test_most;  /* and what passes */
static const char *test_of;

/* The number `a` of a line in a row. */
static double test_number(const test_line *line, int32_t row, int element)
{
    return (double)test_numbers[line->a + ((uint32_t)line->next * (uint32_t)row) + (uint32_t)element];
}

static double test_read(int slot, const test_port *port, int element)
{
    const unsigned char *const at = (const unsigned char *)&test_states[slot] + port->offset;
    tff_real real;
    int32_t integer;
    uint32_t word;
    double value = test_answers[slot];
    int number;

    if (port->type == 'r') {
        memcpy(&real, at + ((size_t)element * sizeof real), sizeof real);
        value = (double)real;
    } else if (port->type == 'i') {
        memcpy(&integer, at + ((size_t)element * sizeof integer), sizeof integer);
        value = (double)integer;
    } else if (port->type == 'n') {
        memcpy(&number, at + ((size_t)element * sizeof number), sizeof number);
        value = (double)number;
    } else if (port->type == 'u') {
        memcpy(&word, at + ((size_t)element * sizeof word), sizeof word);
        value = (double)word;
    } else if (port->type == 'd') {
        memcpy(&value, at + ((size_t)element * sizeof value), sizeof value);
    } else {
        /* what the last call returned */
    }
    return value;
}

static void test_write(int slot, const test_port *port, double value)
{
    unsigned char *const at = (unsigned char *)&test_states[slot] + port->offset;
    const tff_real real = (tff_real)value;

    if (port->type == 'r') {
        memcpy(at, &real, sizeof real);
    } else {
        const int32_t integer = (int32_t)value;
        memcpy(at, &integer, sizeof integer);
    }
}

static double test_look(const test_line *line, const test_port *ports, int element)
{
    double value = test_read(line->slot, &ports[line->port], element);

    if (line->look == TEST_CHANGE) {
        value -= test_read(TEST_BEFORE, &ports[line->port], element);
    } else if (line->look == TEST_APART) {
        value -= test_read(line->other, &ports[line->versus], element);
    } else {
        /* the output itself */
    }
    return value;
}

/* FNV-1a over the bytes of a number, least significant first. */
static void test_add(tff_real value)
{
    uint8_t bytes[sizeof value];
    const uint32_t one = 1u;
    uint8_t little;
    size_t k;

    memcpy(&little, &one, 1);
    memcpy(bytes, &value, sizeof value);
    for (k = 0u; k < sizeof value; k++) {
        test_sum = (test_sum ^ bytes[(little != 0u) ? k : ((sizeof value - 1u) - k)]) * UINT32_C(16777619);
    }
}

/* Say what is wrong, the first time that a check fails. */
static void test_fail(int32_t row, const char *port, double got, double from, double to)
{
    if (test_failed == 0) {
        printf("FAILS  %s: %s; row %ld of %ld, %s: got %.9g, expected ", test_modules[test_now->module].name, test_name,
               (long)row + 1, (long)test_now->rows, port, got);
        if (from < to) {
            printf("%.9g to %.9g\n", from, to);
        } else {
            printf("%.9g\n", from);
        }
    }
    test_failed++;
}

static void test_near(int32_t row, const char *port, double off, double got, double expected, double most)
{
    const double share = (most > 0.0) ? (off / most) : ((off <= 0.0) ? 0.0 : 2.0);

    if (!(share <= test_worst)) { /* this way round NaN counts */
        test_worst = share;
        test_off = off;
        test_most = most;
        test_of = port;
    }
    if (!(off <= most)) {
        test_fail(row, port, got, expected - most, expected + most);
    }
}

/* The size of the mean of the last differences; 0 where there are fewer. */
static double test_mean(int32_t row, double off)
{
    double sum = 0.0;
    int k;

    test_kept = ((row == 0) || isnan(off)) ? 0 : test_kept;
    if (!isnan(off)) {
        test_last[test_kept % TEST_MEAN_OF] = off;
        test_kept++;
    }
    for (k = 0; (k < TEST_MEAN_OF) && (test_kept >= TEST_MEAN_OF); k++) {
        sum += test_last[k];
    }
    return fabs(sum) / (double)TEST_MEAN_OF;
}

/* Compare one number; whether it is in the range of a condition. */
static int test_compare(const test_line *line, int32_t row, int element)
{
    const test_port *const port = &test_modules[test_now->module].ports[line->port];
    const double got = test_look(line, test_modules[test_now->module].ports, element);
    const double a = test_number(line, row, element);
    const double b = (double)test_numbers[line->b];
    int inside = 1;

    if (line->act == TEST_MEAN) {
        test_near(row, port->name, test_mean(row, got - a), got, a, b);
    } else if (line->act == TEST_NEAR) {
        if (!isnan(a)) {
            test_near(row, port->name, fabs(got - a), got, a, b);
        }
    } else {
        inside = ((got >= a) && (got <= b)) ? 1 : 0;
        if ((line->act == TEST_WITHIN) && (inside == 0)) {
            test_fail(row, port->name, got, a, b);
        }
    }
    return inside;
}

/* Carry out a line; how many lines behind it are left out. */
static int test_act(const test_line *line, int32_t row)
{
    const test_module *const module = &test_modules[test_now->module];
    const test_port *const port = &module->ports[line->port];
    int skip = 0;
    int k;

    switch (line->act) {
    case TEST_GIVE:
        for (k = 0; k < (int)line->other; k++) {
            test_inputs[(int)line->port + k] = (tff_real)(test_number(line, row, k) + ((double)row * (double)test_numbers[line->b]));
        }
        break;
    case TEST_CALL:
        test_states[TEST_BEFORE] = test_states[line->slot];
        test_answers[TEST_BEFORE] = test_answers[line->slot];
        test_answers[line->slot] = module->call(&test_states[line->slot], line->port, test_inputs);
        break;
    case TEST_WRITE:
        test_write(line->slot, port, test_number(line, row, 0));
        break;
    case TEST_COPY:
        test_states[line->slot] = test_states[line->other];
        test_answers[line->slot] = test_answers[line->other];
        break;
    case TEST_FILL:
        memset(&test_states[line->slot], line->other, sizeof test_states[0]);
        break;
    case TEST_BITS:
    case TEST_WHEN_BITS: {
        const uint32_t word = (uint32_t)test_read(line->slot, port, 0) & line->a;
        if (word != line->b) {
            skip = (int)line->other;
            if (line->act == TEST_BITS) {
                test_fail(row, port->name, (double)word, (double)line->b, (double)line->b);
            }
        }
        break;
    }
    case TEST_SUM:
        test_sum = (row == 0) ? UINT32_C(2166136261) : test_sum;
        test_add((tff_real)test_answers[line->slot]);
        if ((row == (test_now->rows - 1)) && (test_sum != line->a)) {
            test_fail(row, "checksum", (double)test_sum, (double)line->a, (double)line->a);
        }
        break;
    default:
        for (k = 0; k < (int)port->count; k++) {
            skip = (test_compare(line, row, k) == 0) ? (int)line->other : skip;
        }
        break;
    }
    return skip;
}

static void test_play(const test_check *check)
{
    const uint32_t end = check->first + check->lines;
    int32_t row;
    uint32_t k;

    test_now = check;
    if (check->name != NULL) {
        test_name = check->name;
        test_failed = 0;
        test_worst = -1.0;
    }
    for (row = 0; row < check->rows; row++) {
        for (k = check->first; k < end; k++) {
            k += (uint32_t)test_act(&test_lines[k], row);
        }
    }
}

/* The result of the check under way. */
static void test_report(void)
{
    printf("%s %s: %s", (test_failed == 0) ? "passes" : "FAILS ", test_modules[test_now->module].name, test_name);
    if (test_worst >= 0.0) {
        printf(", largest difference of %s %.3g, at most %.3g", test_of, test_off, test_most);
    }
    printf("\n");
    test_failures += (test_failed == 0) ? 0 : 1;
}

int main(void)
{
    const uint32_t checks = (uint32_t)(sizeof test_checks / sizeof test_checks[0]);
    uint32_t k;

    for (k = 0u; k < checks; k++) {
        test_play(&test_checks[k]);
        if ((k == (checks - 1u)) || (test_checks[k + 1u].name != NULL)) {
            test_report();
        }
    }
#ifdef TEST_DRIVE
    TEST_DRIVE();
    printf("%s calls at random\n", (drive_failures == 0) ? "passes" : "FAILS ");
    test_failures += drive_failures;
#endif
    printf("%s\n", (test_failures == 0) ? "self test passed" : "SELF TEST FAILED");
    return (test_failures == 0) ? 0 : 1;
}

#endif
