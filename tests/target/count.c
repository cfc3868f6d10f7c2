/* QEMU plugin: instructions between calls of two marker functions, by turns of several kinds.
 *
 * -plugin libcount.so,begin=ADDRESS,end=ADDRESS,kinds=K: the k-th pair of markers belongs to kind k mod K. At exit one
 * line per kind: kind, pairs, fewest, most and mean instructions. Kind 0 shall be an empty pair; its count is taken off.
 * The prototypes stand here because distributions ship QEMU without its plugin header.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
typedef struct qemu_info_t qemu_info_t;
enum { NO_REGISTERS = 0 };
enum { INLINE_ADD_U64 = 0 };

__attribute__((visibility("default"))) int qemu_plugin_version = 1;
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int, void *, uint64_t);
void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *, void (*)(unsigned, void *), int, void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, void *), void *);

#define MOST_KINDS 16

static uint64_t count, begun, begin_address, end_address;
static unsigned kinds = 1, turn;
static uint64_t pairs[MOST_KINDS], least[MOST_KINDS], most[MOST_KINDS], sum[MOST_KINDS];

static void begin(unsigned cpu, void *data)
{
    (void)cpu;
    (void)data;
    begun = count;
}

static void end(unsigned cpu, void *data)
{
    const uint64_t taken = count - begun;
    (void)cpu;
    (void)data;
    if (pairs[turn] == 0 || taken < least[turn]) {
        least[turn] = taken;
    }
    if (taken > most[turn]) {
        most[turn] = taken;
    }
    sum[turn] += taken;
    pairs[turn]++;
    turn = (turn + 1) % kinds;
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *tb)
{
    const size_t n = qemu_plugin_tb_n_insns(tb);
    size_t i;
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(tb, INLINE_ADD_U64, &count, n);
    for (i = 0; i < n; i++) {
        struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);
        const uint64_t address = qemu_plugin_insn_vaddr(insn);
        if (address == begin_address) {
            qemu_plugin_register_vcpu_insn_exec_cb(insn, begin, NO_REGISTERS, NULL);
        } else if (address == end_address) {
            qemu_plugin_register_vcpu_insn_exec_cb(insn, end, NO_REGISTERS, NULL);
        }
    }
}

static void finish(qemu_plugin_id_t id, void *data)
{
    unsigned k;
    (void)id;
    (void)data;
    for (k = 0; k < kinds; k++) {
        fprintf(stderr, "count %u %" PRIu64 " %" PRIu64 " %" PRIu64 " %.1f\n", k, pairs[k], least[k] - least[0],
                most[k] - least[0], pairs[k] ? ((double)sum[k] / (double)pairs[k]) - (double)least[0] : 0.0);
    }
}

__attribute__((visibility("default"))) int qemu_plugin_install(
    qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv)
{
    int i;
    (void)info;
    for (i = 0; i < argc; i++) {
        const char *value = strchr(argv[i], '=');
        if (value == NULL) {
            return 1;
        }
        if (strncmp(argv[i], "begin=", 6) == 0) {
            begin_address = strtoull(value + 1, NULL, 0) & ~UINT64_C(1);
        } else if (strncmp(argv[i], "end=", 4) == 0) {
            end_address = strtoull(value + 1, NULL, 0) & ~UINT64_C(1);
        } else if (strncmp(argv[i], "kinds=", 6) == 0) {
            kinds = (unsigned)strtoul(value + 1, NULL, 0);
        }
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, finish, NULL);
    return (kinds == 0 || kinds > MOST_KINDS) ? 1 : 0;
}
