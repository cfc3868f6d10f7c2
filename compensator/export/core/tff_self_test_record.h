/* Acts of a line. */
enum {
    TEST_GIVE,      /* input `port` becomes the number `a`, and so much as `b` more in each row; `other` inputs do */
    TEST_CALL,      /* call number `port` of the module, with the inputs given so far */
    TEST_WRITE,     /* member `port` of the state becomes the number `a` */
    TEST_COPY,      /* the state becomes that of the slot `other` */
    TEST_FILL,      /* the state becomes bytes `other` */
    TEST_NEAR,      /* at most `b` from `a`; not compared where `a` is NaN */
    TEST_MEAN,      /* the mean of the last TEST_MEAN_OF differences from `a` is at most `b` */
    TEST_WITHIN,    /* from `a` to `b` */
    TEST_BITS,      /* of the bits `a` those of `b` are set, and no others */
    TEST_WHEN,      /* the next `other` lines only where all numbers are from `a` to `b` */
    TEST_WHEN_BITS, /* and only where of the bits `a` those of `b` are set, and no others */
    TEST_SUM        /* the checksum of all rows is `a` */
};

/* What a line looks at. */
enum {
    TEST_VALUE,  /* the output */
    TEST_CHANGE, /* its change since before the last call of any slot */
    TEST_APART   /* its difference from the output `versus` of the slot `other` */
};

/* An output of a module, or any other member of its state. */
typedef struct {
    const char *name; /* with its unit */
    uint32_t offset;
    uint16_t count;
    char type; /* r tff_real, i int32_t, u uint32_t, n int, d double, c what the last call returned */
} test_port;

typedef struct {
    const char *name;
    double (*call)(void *state, int which, const tff_real *in); /* what it returns; 0 where that is nothing */
    const test_port *ports;
} test_module;

/* `a` and `b` are places in test_numbers, `next` is how far the next row of `a` is from there; of bits the bits themselves. */
typedef struct {
    uint8_t act, slot, port, look, other, versus;
    uint16_t next;
    uint32_t a, b;
} test_line;

typedef struct {
    const char *name; /* NULL: more rows of the check before */
    uint16_t module, lines;
    int32_t rows;
    uint32_t first; /* of its lines */
} test_check;
