/* Doubles as the shortest decimal text that reads back as the same double, many at once.
 *
 * A double is m 2^e with m < 2^53. Where 1e-5 <= x < 1e9, m 10^D fits into 128 bits for every number D of decimals that
 * 15, 16 or 17 significant digits need, so the rounded digits c = m 10^D 2^e are exact, and so is the question whether
 * they read back as x: they do if abs(c 2^-e - m 10^D) < 10^D/2, half a unit of m. 17 digits always do.
 * Other numbers go through the C library, with 17 digits.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef unsigned __int128 wide;

static const uint64_t TENS[20] = {
    1u, 10u, 100u, 1000u, 10000u, 100000u, 1000000u, 10000000u, 100000000u, 1000000000u, 10000000000u,
    100000000000u, 1000000000000u, 10000000000000u, 100000000000000u, 1000000000000000u, 10000000000000000u,
    100000000000000000u, 1000000000000000000u, 10000000000000000000u};

static const char PAIRS[201] =
    "00010203040506070809101112131415161718192021222324252627282930313233343536373839404142434445464748495051525354555657"
    "5859606162636465666768697071727374757677787980818283848586878889909192939495969798"
    "99";

static wide power_of_ten(int exponent)
{
    return (exponent < 20) ? (wide)TENS[exponent] : (wide)TENS[19] * TENS[exponent - 19];
}

static void eight_digits(uint32_t value, char *out)
{
    const uint32_t high = value / 10000u;
    const uint32_t low = value % 10000u;
    memcpy(&out[0], &PAIRS[2u * (high / 100u)], 2);
    memcpy(&out[2], &PAIRS[2u * (high % 100u)], 2);
    memcpy(&out[4], &PAIRS[2u * (low / 100u)], 2);
    memcpy(&out[6], &PAIRS[2u * (low % 100u)], 2);
}

/* Whether c with D decimals reads back as m 2^e. */
static int reads_back(uint64_t c, int decimals, uint64_t m, int e)
{
    const wide scale = power_of_ten(decimals);
    const wide exact = (wide)m * scale;
    const wide back = (wide)c << -e;
    const wide apart = (back > exact) ? (back - exact) : (exact - back);
    return 2u * apart < ((m == 0x10000000000000u) ? scale / 2u : scale); /* below a power of two doubles lie closer */
}

/* Text of x > 0; returns its length, 0 where this way does not reach. Writes up to 48 bytes. */
static int short_text(double x, char *out)
{
    static const double bounds[15] = {1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
    char buffer[64];
    uint64_t bits, m, c, shorter;
    int e, place, decimals, digits, half, whole;
    if (!((x >= 1e-5) && (x < 1e9))) {
        return 0;
    }
    memcpy(&bits, &x, sizeof bits);
    e = (int)(bits >> 52) - 1075;
    m = (bits & 0xFFFFFFFFFFFFFu) | 0x10000000000000u;
    place = (((e + 52) * 1233) >> 12) + 5; /* log10 of 2 is 1233/4096: this many bounds or one less are reached */
    place += (x >= bounds[place + 1]) ? 1 : 0;
    place -= (x < bounds[place]) ? 1 : 0;
    place -= 4; /* digits before the point; minus the zeros after it where there are none */
    decimals = 17 - place;
    digits = 17;
    c = (uint64_t)((((wide)m * power_of_ten(decimals)) + ((wide)1 << (-e - 1))) >> -e);
    half = (int)(c / m) / 2 + 2; /* half a unit of m in units of c, rounded up: what is farther off cannot read back */
    shorter = (c + 50u) / 100u;
    if ((llabs((long long)(shorter * 100u) - (long long)c) <= half) && reads_back(shorter, decimals - 2, m, e)) {
        c = shorter;
        digits = 15;
    } else {
        shorter = (c + 5u) / 10u;
        if (((c % 10u) == 5u) && !reads_back(shorter, decimals - 1, m, e)) {
            shorter--; /* c itself was rounded up to the 5 */
        }
        if ((llabs((long long)(shorter * 10u) - (long long)c) <= half) && reads_back(shorter, decimals - 1, m, e)) {
            c = shorter;
            digits = 16;
        }
    }
    decimals -= 17 - digits;
    c *= TENS[17 - digits];
    if (c >= TENS[17]) { /* 9.99...: rounded up to one more digit, which is a zero */
        c /= 10u;
        place++;
    }
    memset(buffer, '0', 8);
    buffer[8] = (char)('0' + (c / TENS[16]));
    eight_digits((uint32_t)((c / TENS[8]) % TENS[8]), &buffer[9]);
    eight_digits((uint32_t)(c % TENS[8]), &buffer[17]);
    whole = (place > 0) ? place : 1;
    { /* 17 digits from buffer[8], zeros before them where the number is below one */
        const char *const start = &buffer[(place > 0) ? 8 : 7 + place];
        memcpy(out, start, 24);
        memcpy(&out[whole + 1], &start[whole], 24);
        out[whole] = '.';
        digits = (int)(&buffer[25] - start) + 1;
    }
    while ((out[digits - 1] == '0') && (out[digits - 2] != '.')) {
        digits--;
    }
    return digits;
}

/* Rows of numbers as lines of comma-separated text; out has 26 bytes per number and 64 more. Returns the bytes used. */
long tff_csv_text(const double *values, long rows, long columns, char *out)
{
    char *now = out;
    long row, column;
    for (row = 0; row < rows; row++) {
        for (column = 0; column < columns; column++) {
            const double x = *values++;
            char *const text = signbit(x) ? now + 1 : now;
            int length = short_text(fabs(x), text);
            if (length > 0) {
                *now = signbit(x) ? '-' : *now;
                now = text + length;
            } else if (x == 0.0) {
                now += sprintf(now, "%s", signbit(x) ? "-0.0" : "0.0");
            } else {
                now += sprintf(now, "%.17g", x);
            }
            *now++ = (column + 1 < columns) ? ',' : '\n';
        }
    }
    return (long)(now - out);
}
