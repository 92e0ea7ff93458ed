/* QEMU TCG plugin: floating-point arithmetic in f64 that the guest executes between two addresses, and how
 * many bytes of code it does it with.
 *
 *   qemu-system-arm ... -plugin ./count.so,begin=0xADDR,end=0xADDR,out=FILE
 *
 * FILE gets one line of decimal numbers per pass from `begin` to `end`: the operations, then the bytes of code
 * executed at least 1, 2, 4, ... 2048 times in the pass. Callbacks only, no inline operations: those changed
 * between versions of the plugin interface. The prototypes needed are
 * declared here because distributions do not package qemu-plugin.h. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
typedef struct qemu_info_t qemu_info_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };
typedef void (*vcpu_udata_cb)(unsigned vcpu, void *userdata);
typedef void (*vcpu_tb_trans_cb)(qemu_plugin_id_t, struct qemu_plugin_tb *);
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
extern struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
extern size_t qemu_plugin_insn_size(const struct qemu_plugin_insn *);
extern uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *);
extern void qemu_plugin_register_vcpu_tb_exec_cb(
    struct qemu_plugin_tb *, vcpu_udata_cb, enum qemu_plugin_cb_flags, void *);
extern char *qemu_plugin_insn_disas(const struct qemu_plugin_insn *);
extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, vcpu_tb_trans_cb);
extern void qemu_plugin_register_vcpu_insn_exec_cb(
    struct qemu_plugin_insn *, vcpu_udata_cb, enum qemu_plugin_cb_flags, void *);

#define EXPORT __attribute__((visibility("default")))
EXPORT int qemu_plugin_version = 1;

static uint64_t begin_address, end_address, operations;
static int inside;
static FILE *out;

/* Code lies in the first 4 MiB, in units of two bytes. A block is counted as a whole; what it is cut into
 * differs between runs of QEMU, the sum over each address does not. */
enum { UNITS = 1 << 21, POWERS = 12, MAX_BLOCKS = 1 << 16 };
struct block {
    uint32_t first, units;
    uint64_t executed;
    struct block *next;
};
static struct block blocks[MAX_BLOCKS], *executed_blocks;
static size_t n_blocks;
static uint64_t times[UNITS];

static void on_begin(unsigned vcpu, void *userdata) {
    (void)vcpu, (void)userdata;
    operations = 0;
    executed_blocks = NULL;
    inside = 1;
}

static void on_block(unsigned vcpu, void *userdata) {
    (void)vcpu;
    struct block *block = userdata;
    if (!inside) return;
    if (!block->executed) {
        block->next = executed_blocks;
        executed_blocks = block;
    }
    block->executed++;
}

/* Bytes executed at least 2^k times; forgets the blocks of the pass. */
static void print_code(void) {
    uint64_t units[POWERS] = {0};
    for (struct block *block = executed_blocks; block; block = block->next)
        for (uint32_t i = 0; i < block->units; i++) times[block->first + i] += block->executed;
    for (struct block *block = executed_blocks; block; block = block->next) {
        for (uint32_t i = 0; i < block->units; i++) {
            uint64_t *count = &times[block->first + i];
            for (int k = 0; k < POWERS; k++) units[k] += *count >= (uint64_t)1 << k;
            *count = 0;
        }
        block->executed = 0;
    }
    for (int k = 0; k < POWERS; k++) fprintf(out, " %" PRIu64, 2 * units[k]);
}

static void on_end(unsigned vcpu, void *userdata) {
    (void)vcpu, (void)userdata;
    if (!inside) return;
    inside = 0;
    fprintf(out, "%" PRIu64, operations);
    print_code();
    fprintf(out, "\n");
    fflush(out); /* the guest may end QEMU without an exit handler */
}

static void on_operation(unsigned vcpu, void *userdata) {
    (void)vcpu, (void)userdata;
    operations++;
}

/* Addition, multiplication, division, root, fused or not; no moves, loads, comparisons, conversions. */
static int is_f64_arithmetic(const char *text) {
    static const char *const NAMES[] = {
        "vadd", "vsub", "vmul", "vdiv", "vsqrt", "vmla", "vmls", "vnmul", "vnmla", "vnmls", "vfma", "vfms", "vfnma", "vfnms",
    };
    if (!strstr(text, ".f64")) return 0;
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES; i++)
        if (!strncmp(text, NAMES[i], strlen(NAMES[i]))) return 1;
    return 0;
}

static void on_translation(qemu_plugin_id_t id, struct qemu_plugin_tb *block) {
    (void)id;
    uint64_t first = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, 0)), bytes = 0;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); i++)
        bytes += qemu_plugin_insn_size(qemu_plugin_tb_get_insn(block, i));
    if (n_blocks < MAX_BLOCKS && (first + bytes) / 2 <= UNITS) {
        struct block *own = &blocks[n_blocks++];
        own->first = first / 2;
        own->units = bytes / 2;
        qemu_plugin_register_vcpu_tb_exec_cb(block, on_block, QEMU_PLUGIN_CB_NO_REGS, own);
    }
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); i++) {
        struct qemu_plugin_insn *instruction = qemu_plugin_tb_get_insn(block, i);
        uint64_t address = qemu_plugin_insn_vaddr(instruction);
        vcpu_udata_cb callback = NULL;
        if (address == begin_address) {
            callback = on_begin;
        } else if (address == end_address) {
            callback = on_end;
        } else {
            char *text = qemu_plugin_insn_disas(instruction);
            if (text && is_f64_arithmetic(text)) callback = on_operation;
            free(text);
        }
        if (callback)
            qemu_plugin_register_vcpu_insn_exec_cb(instruction, callback, QEMU_PLUGIN_CB_NO_REGS, NULL);
    }
}

EXPORT int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv) {
    (void)info;
    for (int i = 0; i < argc; i++) {
        /* Function symbols carry the Thumb bit, instruction addresses do not. */
        if (!strncmp(argv[i], "begin=", 6)) begin_address = strtoull(argv[i] + 6, NULL, 0) & ~1ull;
        if (!strncmp(argv[i], "end=", 4)) end_address = strtoull(argv[i] + 4, NULL, 0) & ~1ull;
        if (!strncmp(argv[i], "out=", 4)) out = fopen(argv[i] + 4, "w");
    }
    if (!out) return -1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation);
    return 0;
}
