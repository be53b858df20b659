/* An FMI 3.0 co-simulation FMU that hands every call to a process of brakebench ("python3 -m hil.fmu.serve").
 *
 * Values are kept here: set calls mark them, and the next call that needs the model sends what was marked and brings
 * all values back, one message each way. The counterpart is hil/fmu/serve.py. POSIX only.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define API __attribute__((visibility("default")))
#define INTEGERS 0x10000u /* value references: reals from 0, then integers, booleans (kept as integers), and these */
#define BOOLEANS 0x20000u
#define RX_DATA 0x30000u
#define TX_DATA 0x30001u
#define RX_CLOCK 0x30002u
#define TX_CLOCK 0x30003u
#define TIME 0x30004u
#define START_TIMEOUT_S 600 /* the first start compiles the model */
#define STEP_TIMEOUT_S 60

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATE, SYNC, INITIALISE, STEP, EVENT, GET_STATE, SET_STATE, RESET };
enum { HAS_TX = 1 };
enum mode { INSTANTIATED, INITIALISING, IN_STEP, IN_EVENT, TERMINATED, DEAD };

typedef int fmi3Status;
typedef uint32_t Ref;
typedef void (*Log)(void *, fmi3Status, const char *, const char *);

typedef struct {
    void *environment;
    Log log;
    char *name, *resources;
    bool event_mode, marked, rx_clock, tx_clock;
    enum mode mode;
    int fd;
    pid_t pid;
    uint32_t n_real, n_int;
    double *real, time;
    int64_t *integer;
    uint8_t *real_set, *int_set, *rx, *tx, *reply;
    size_t n_rx, n_tx, reply_room;
} Instance;

typedef struct { /* what fmi3GetFMUState gives, bytes of the process behind it */
    uint64_t size;
    uint32_t mode, rx_clock, n_rx;
    uint32_t padding;
} State;

typedef struct { uint32_t size, op; double a, b; uint32_t n_real, n_int, n_bytes, flags; } Request;
typedef struct { uint32_t size, status; } ReplyHead;
typedef struct { double time; uint32_t flags, n_bytes, n_real, n_int; } Reply;

extern char **environ;

static fmi3Status say(Instance *m, fmi3Status status, const char *text) {
    if (m->log) m->log(m->environment, status, status == FATAL ? "logStatusFatal" : "logStatusError", text);
    return status;
}

static fmi3Status dead(Instance *m, const char *why) {
    char text[400];
    snprintf(text, sizeof text, "the process of brakebench behind %s %s", m->name, why);
    m->mode = DEAD;
    return say(m, FATAL, text);
}

static bool put(Instance *m, const void *data, size_t n) {
    const char *from = data;
    while (n) {
        ssize_t done = send(m->fd, from, n, MSG_NOSIGNAL);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return false;
        from += done, n -= (size_t)done;
    }
    return true;
}

/* 1 read, 0 gone, -1 nothing within the time */
static int take(Instance *m, void *data, size_t n, int timeout_s) {
    char *to = data;
    while (n) {
        struct pollfd ready = {m->fd, POLLIN, 0};
        int some = poll(&ready, 1, timeout_s * 1000);
        if (some < 0 && errno == EINTR) continue;
        if (some == 0) return -1;
        ssize_t done = some < 0 ? -1 : recv(m->fd, to, n, 0);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return 0;
        to += done, n -= (size_t)done;
    }
    return 1;
}

static bool resize(Instance *m, uint32_t n_real, uint32_t n_int) {
    m->n_real = n_real, m->n_int = n_int;
    m->real = calloc(n_real + 1, sizeof *m->real), m->real_set = calloc(n_real + 1, 1);
    m->integer = calloc(n_int + 1, sizeof *m->integer), m->int_set = calloc(n_int + 1, 1);
    return m->real && m->real_set && m->integer && m->int_set;
}

/* One call to the process: marked values go there, all values come back. Bytes that come stay in `bytes`. */
static fmi3Status call(Instance *m, uint32_t op, double a, double b, const void *arg, size_t n_arg,
                       const uint8_t **bytes, size_t *n_bytes) {
    if (m->mode == DEAD) return FATAL;
    uint32_t n_real = 0, n_int = 0;
    for (uint32_t i = 0; m->marked && i < m->n_real; i++) n_real += m->real_set[i];
    for (uint32_t i = 0; m->marked && i < m->n_int; i++) n_int += m->int_set[i];
    size_t size = sizeof(Request) + 12 * (size_t)(n_real + n_int) + n_arg;
    uint8_t *request = malloc(size), *at = request + sizeof(Request);
    if (!request) return say(m, FATAL, "no memory");
    Request head = {(uint32_t)(size - 8), op, a, b, n_real, n_int, (uint32_t)n_arg, m->event_mode};
    memcpy(request, &head, sizeof head);
    for (uint32_t i = 0; n_real && i < m->n_real; i++)
        if (m->real_set[i]) memcpy(at, &m->real[i], 8), at += 8;
    for (uint32_t i = 0; n_int && i < m->n_int; i++)
        if (m->int_set[i]) memcpy(at, &m->integer[i], 8), at += 8;
    for (uint32_t i = 0; n_real && i < m->n_real; i++)
        if (m->real_set[i]) memcpy(at, &i, 4), at += 4;
    for (uint32_t i = 0; n_int && i < m->n_int; i++)
        if (m->int_set[i]) memcpy(at, &i, 4), at += 4;
    if (n_arg) memcpy(at, arg, n_arg);
    bool sent = put(m, request, size);
    free(request);
    if (!sent) return dead(m, "has ended; its last words are on the standard error");
    ReplyHead reply_head;
    int timeout_s = op == INSTANTIATE || op == INITIALISE ? START_TIMEOUT_S : STEP_TIMEOUT_S;
    int came = take(m, &reply_head, sizeof reply_head, timeout_s);
    if (came > 0 && m->reply_room < reply_head.size + 1u) {
        free(m->reply);
        m->reply_room = reply_head.size + 1u;
        m->reply = malloc(m->reply_room);
        if (!m->reply) return say(m, FATAL, "no memory");
    }
    if (came > 0) came = take(m, m->reply, reply_head.size, timeout_s);
    if (came < 0) return dead(m, "does not answer");
    if (came == 0) return dead(m, "has ended; its last words are on the standard error");
    if (reply_head.status != OK) {
        m->reply[reply_head.size] = 0;
        return say(m, ERROR, (const char *)m->reply);
    }
    Reply reply;
    memcpy(&reply, m->reply, sizeof reply);
    if (op == INSTANTIATE && !m->real && !resize(m, reply.n_real, reply.n_int)) return say(m, FATAL, "no memory");
    m->time = reply.time;
    at = m->reply + sizeof reply;
    memcpy(m->real, at, 8 * (size_t)m->n_real), at += 8 * (size_t)m->n_real;
    memcpy(m->integer, at, 8 * (size_t)m->n_int), at += 8 * (size_t)m->n_int;
    if (m->marked) memset(m->real_set, 0, m->n_real), memset(m->int_set, 0, m->n_int);
    m->marked = false;
    if (bytes) *bytes = at, *n_bytes = reply.n_bytes;
    if (op == GET_STATE) return OK;
    m->tx_clock = reply.flags & HAS_TX;
    m->n_tx = m->tx_clock ? reply.n_bytes : 0;
    free(m->tx);
    m->tx = m->n_tx ? malloc(m->n_tx) : NULL;
    if (m->tx) memcpy(m->tx, at, m->n_tx);
    return OK;
}

static fmi3Status simple(Instance *m, uint32_t op, double a, double b) {
    return call(m, op, a, b, NULL, 0, NULL, NULL);
}

static bool start_process(Instance *m) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends)) return false;
    const char *python = getenv("BRAKEBENCH_PYTHON");
    char *words[] = {(char *)(python && *python ? python : "python3"), "-P", "-m", "hil.fmu.serve", NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    sigset_t none;
    sigemptyset(&none);
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], 0);
    posix_spawn_file_actions_adddup2(&files, 2, 1); /* the importer's standard output is its own */
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setpgroup(&attributes, 0); /* a Ctrl-C is the importer's to handle: the process ends with it */
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
    int failed = posix_spawnp(&m->pid, words[0], &files, &attributes, words, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
    close(ends[1]);
    m->fd = ends[0];
    if (failed) m->pid = 0;
    return !failed;
}

/* Instances */

API const char *fmi3GetVersion(void) { return "3.0"; }

API void fmi3FreeInstance(void *instance) {
    Instance *m = instance;
    if (!m) return;
    if (m->fd >= 0) close(m->fd); /* the process ends when its socket does */
    for (int k = 0; m->pid > 0 && k < 200; k++) {
        pid_t gone = waitpid(m->pid, NULL, WNOHANG);
        if (gone == m->pid || (gone < 0 && errno == ECHILD)) m->pid = 0;
        else usleep(10000);
    }
    if (m->pid > 0) kill(m->pid, SIGKILL), waitpid(m->pid, NULL, 0);
    free(m->name), free(m->resources), free(m->real), free(m->integer), free(m->real_set), free(m->int_set);
    free(m->rx), free(m->tx), free(m->reply), free(m);
}

API void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                      bool logging, bool event_mode, bool early_return, const Ref wanted[],
                                      size_t n_wanted, void *environment, Log log, void *intermediate) {
    (void)visible, (void)logging, (void)early_return, (void)wanted, (void)n_wanted, (void)intermediate;
    Instance *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->environment = environment, m->log = log, m->fd = -1, m->event_mode = event_mode;
    m->name = strdup(name ? name : "");
    m->resources = strdup(resources ? resources : "");
    size_t n = strlen(m->resources) + 1 + (token ? strlen(token) : 0);
    char *told = calloc(1, n + 1);
    if (told) sprintf(told, "%s\n%s", m->resources, token ? token : "");
    bool started = told && start_process(m);
    if (!started) say(m, FATAL, "cannot start python3; BRAKEBENCH_PYTHON names a Python that has brakebench installed");
    if (!started || call(m, INSTANTIATE, 0, 0, told, n, NULL, NULL) != OK) {
        fmi3FreeInstance(m);
        m = NULL;
    }
    free(told);
    return m;
}

API void *fmi3InstantiateModelExchange(const char *a, const char *b, const char *c, bool d, bool e, void *f, Log g) {
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g;
    return NULL;
}

API void *fmi3InstantiateScheduledExecution(const char *a, const char *b, const char *c, bool d, bool e, void *f,
                                            Log g, void *h, void *i, void *j) {
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h, (void)i, (void)j;
    return NULL;
}

API fmi3Status fmi3SetDebugLogging(void *m, bool on, size_t n, const char *const names[]) {
    (void)m, (void)on, (void)n, (void)names;
    return OK;
}

static fmi3Status expect(Instance *m, enum mode mode, const char *what) {
    if (m->mode == mode) return OK;
    return m->mode == DEAD ? FATAL : say(m, ERROR, what);
}

API fmi3Status fmi3EnterConfigurationMode(void *m) { (void)m; return OK; }
API fmi3Status fmi3ExitConfigurationMode(void *m) { (void)m; return OK; }

API fmi3Status fmi3EnterInitializationMode(void *instance, bool has_tolerance, double tolerance, double start,
                                           bool has_stop, double stop) {
    Instance *m = instance;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    fmi3Status wrong = expect(m, INSTANTIATED, "fmi3EnterInitializationMode: only once, after fmi3Instantiate or fmi3Reset");
    if (wrong != OK) return wrong;
    fmi3Status status = simple(m, SYNC, start, 0);
    if (status == OK) m->mode = INITIALISING, m->time = start;
    return status;
}

API fmi3Status fmi3ExitInitializationMode(void *instance) {
    Instance *m = instance;
    fmi3Status wrong = expect(m, INITIALISING, "fmi3ExitInitializationMode: not in initialization mode");
    if (wrong != OK) return wrong;
    fmi3Status status = simple(m, INITIALISE, m->time, 0);
    if (status == OK) m->mode = m->event_mode ? IN_EVENT : IN_STEP;
    return status;
}

API fmi3Status fmi3EnterEventMode(void *instance) {
    Instance *m = instance;
    if (!m->event_mode) return say(m, ERROR, "fmi3EnterEventMode: instantiated without event mode");
    fmi3Status wrong = expect(m, IN_STEP, "fmi3EnterEventMode: not in step mode");
    if (wrong != OK) return wrong;
    m->mode = IN_EVENT;
    return OK;
}

API fmi3Status fmi3EnterStepMode(void *instance) {
    Instance *m = instance;
    fmi3Status wrong = expect(m, IN_EVENT, "fmi3EnterStepMode: not in event mode");
    if (wrong != OK) return wrong;
    m->mode = IN_STEP;
    return OK;
}

API fmi3Status fmi3Terminate(void *instance) {
    Instance *m = instance;
    if (m->mode == DEAD) return FATAL;
    m->mode = TERMINATED;
    return OK;
}

API fmi3Status fmi3Reset(void *instance) {
    Instance *m = instance;
    m->rx_clock = false, m->n_rx = 0;
    fmi3Status status = simple(m, RESET, 0, 0);
    if (status == OK) m->mode = INSTANTIATED;
    return status;
}

API fmi3Status fmi3DoStep(void *instance, double time, double step, bool no_return, bool *event, bool *terminate,
                          bool *early, double *last) {
    Instance *m = instance;
    (void)no_return;
    fmi3Status wrong = expect(m, IN_STEP, "fmi3DoStep: not in step mode");
    if (wrong != OK) return wrong;
    fmi3Status status = simple(m, STEP, time, step);
    *event = status == OK && m->tx_clock && m->event_mode;
    *terminate = *early = false;
    *last = status == OK ? time + step : m->time;
    return status;
}

API fmi3Status fmi3UpdateDiscreteStates(void *instance, bool *again, bool *terminate, bool *nominals, bool *states,
                                        bool *next_defined, double *next) {
    Instance *m = instance;
    *again = *terminate = *nominals = *states = *next_defined = false, *next = 0;
    fmi3Status wrong = expect(m, IN_EVENT, "fmi3UpdateDiscreteStates: not in event mode");
    if (wrong != OK) return wrong;
    fmi3Status status = call(m, EVENT, 0, 0, m->rx, m->rx_clock ? m->n_rx : 0, NULL, NULL);
    m->rx_clock = false, m->n_rx = 0;
    *again = status == OK && m->tx_clock;
    return status;
}

API fmi3Status fmi3EvaluateDiscreteStates(void *m) { (void)m; return OK; }

/* Values */

static fmi3Status no_variable(Instance *m, Ref ref) {
    char text[80];
    snprintf(text, sizeof text, "value reference %u: no variable of this type", ref);
    return say(m, ERROR, text);
}

static fmi3Status fresh(Instance *m) { /* in initialization mode results follow what was set */
    return m->marked && m->mode == INITIALISING ? simple(m, SYNC, m->time, 0) : OK;
}

API fmi3Status fmi3GetFloat64(void *instance, const Ref ref[], size_t n, double value[], size_t n_values) {
    Instance *m = instance;
    (void)n_values;
    fmi3Status status = fresh(m);
    if (status != OK) return status;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] >= m->n_real && ref[k] != TIME) return no_variable(m, ref[k]);
        value[k] = ref[k] == TIME ? m->time : m->real[ref[k]];
    }
    return OK;
}

API fmi3Status fmi3SetFloat64(void *instance, const Ref ref[], size_t n, const double value[], size_t n_values) {
    Instance *m = instance;
    (void)n_values;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] >= m->n_real) return no_variable(m, ref[k]);
        m->real[ref[k]] = value[k], m->real_set[ref[k]] = 1, m->marked = true;
    }
    return OK;
}

#define OF_INTEGERS(Name, Type, First)                                                                               \
    API fmi3Status fmi3Get##Name(void *instance, const Ref ref[], size_t n, Type value[], size_t n_values) {           \
        Instance *m = instance;                                                                                      \
        (void)n_values;                                                                                              \
        fmi3Status status = fresh(m);                                                                                \
        if (status != OK) return status;                                                                             \
        for (size_t k = 0; k < n; k++) {                                                                             \
            if (ref[k] < First || ref[k] - First >= m->n_int) return no_variable(m, ref[k]);                         \
            value[k] = (Type)m->integer[ref[k] - First];                                                             \
        }                                                                                                            \
        return OK;                                                                                                   \
    }                                                                                                                \
    API fmi3Status fmi3Set##Name(void *instance, const Ref ref[], size_t n, const Type value[], size_t n_values) {     \
        Instance *m = instance;                                                                                      \
        (void)n_values;                                                                                              \
        for (size_t k = 0; k < n; k++) {                                                                             \
            if (ref[k] < First || ref[k] - First >= m->n_int) return no_variable(m, ref[k]);                         \
            m->integer[ref[k] - First] = value[k], m->int_set[ref[k] - First] = 1, m->marked = true;                 \
        }                                                                                                            \
        return OK;                                                                                                   \
    }
OF_INTEGERS(Int32, int32_t, INTEGERS)
OF_INTEGERS(Boolean, bool, BOOLEANS)

API fmi3Status fmi3GetBinary(void *instance, const Ref ref[], size_t n, size_t size[], const uint8_t *value[],
                             size_t n_values) {
    Instance *m = instance;
    (void)n_values;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] != TX_DATA && ref[k] != RX_DATA) return no_variable(m, ref[k]);
        size[k] = ref[k] == TX_DATA ? m->n_tx : m->n_rx;
        value[k] = ref[k] == TX_DATA ? m->tx : m->rx;
    }
    return OK;
}

API fmi3Status fmi3SetBinary(void *instance, const Ref ref[], size_t n, const size_t size[],
                             const uint8_t *const value[], size_t n_values) {
    Instance *m = instance;
    (void)n_values;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] != RX_DATA) return no_variable(m, ref[k]);
        uint8_t *kept = malloc(size[k] + 1);
        if (!kept) return say(m, FATAL, "no memory");
        if (size[k]) memcpy(kept, value[k], size[k]);
        free(m->rx);
        m->rx = kept, m->n_rx = size[k];
    }
    return OK;
}

API fmi3Status fmi3GetClock(void *instance, const Ref ref[], size_t n, bool value[]) {
    Instance *m = instance;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] != TX_CLOCK && ref[k] != RX_CLOCK) return no_variable(m, ref[k]);
        value[k] = ref[k] == TX_CLOCK ? m->tx_clock : m->rx_clock;
    }
    return OK;
}

API fmi3Status fmi3SetClock(void *instance, const Ref ref[], size_t n, const bool value[]) {
    Instance *m = instance;
    for (size_t k = 0; k < n; k++) {
        if (ref[k] != RX_CLOCK) return no_variable(m, ref[k]);
        m->rx_clock = value[k];
    }
    return OK;
}

/* State */

API fmi3Status fmi3GetFMUState(void *instance, void **state) {
    Instance *m = instance;
    const uint8_t *bytes;
    size_t n;
    fmi3Status status = call(m, GET_STATE, 0, 0, NULL, 0, &bytes, &n);
    if (status != OK) return status;
    State head = {sizeof head + m->n_rx + n, m->mode, m->rx_clock, (uint32_t)m->n_rx, 0};
    uint8_t *kept = realloc(*state, head.size);
    if (!kept) return say(m, FATAL, "no memory");
    memcpy(kept, &head, sizeof head);
    if (m->n_rx) memcpy(kept + sizeof head, m->rx, m->n_rx);
    memcpy(kept + sizeof head + m->n_rx, bytes, n);
    *state = kept;
    return OK;
}

API fmi3Status fmi3SetFMUState(void *instance, void *state) {
    Instance *m = instance;
    State head;
    memcpy(&head, state, sizeof head);
    const uint8_t *rest = (const uint8_t *)state + sizeof head;
    uint8_t *rx = malloc(head.n_rx + 1u);
    if (!rx) return say(m, FATAL, "no memory");
    memcpy(rx, rest, head.n_rx);
    if (m->marked) memset(m->real_set, 0, m->n_real), memset(m->int_set, 0, m->n_int); /* the state has all values */
    m->marked = false;
    fmi3Status status =
        call(m, SET_STATE, 0, 0, rest + head.n_rx, head.size - sizeof head - head.n_rx, NULL, NULL);
    free(m->rx);
    m->rx = rx, m->n_rx = head.n_rx;
    if (status == OK) m->mode = (enum mode)head.mode, m->rx_clock = head.rx_clock;
    return status;
}

API fmi3Status fmi3FreeFMUState(void *m, void **state) {
    (void)m;
    if (state) free(*state), *state = NULL;
    return OK;
}

API fmi3Status fmi3SerializedFMUStateSize(void *m, void *state, size_t *size) {
    State head;
    (void)m;
    memcpy(&head, state, sizeof head);
    *size = head.size;
    return OK;
}

API fmi3Status fmi3SerializeFMUState(void *instance, void *state, uint8_t bytes[], size_t size) {
    State head;
    memcpy(&head, state, sizeof head);
    if (size < head.size) return say(instance, ERROR, "fmi3SerializeFMUState: fewer bytes than the state has");
    memcpy(bytes, state, head.size);
    return OK;
}

API fmi3Status fmi3DeserializeFMUState(void *instance, const uint8_t bytes[], size_t size, void **state) {
    State head = {0};
    if (size >= sizeof head) memcpy(&head, bytes, sizeof head);
    if (head.size < sizeof head || head.size > size || head.n_rx > head.size - sizeof head || head.mode >= DEAD)
        return say(instance, ERROR, "fmi3DeserializeFMUState: no state of this FMU");
    uint8_t *kept = realloc(*state, head.size);
    if (!kept) return say(instance, FATAL, "no memory");
    memcpy(kept, bytes, head.size);
    *state = kept;
    return OK;
}

/* What this FMU does not have; an importer that reads its model description calls none of these */

#define ABSENT(Name) \
    API fmi3Status Name(void *instance) { return say(instance, ERROR, #Name ": this FMU does not have it"); }
#define ABSENT_TYPE(Name) ABSENT(fmi3Get##Name) ABSENT(fmi3Set##Name)
ABSENT_TYPE(Float32) ABSENT_TYPE(Int8) ABSENT_TYPE(UInt8) ABSENT_TYPE(Int16) ABSENT_TYPE(UInt16)
ABSENT_TYPE(Int64) ABSENT_TYPE(UInt32) ABSENT_TYPE(UInt64) ABSENT_TYPE(String)
ABSENT_TYPE(IntervalDecimal) ABSENT_TYPE(IntervalFraction) ABSENT_TYPE(ShiftDecimal) ABSENT_TYPE(ShiftFraction)
ABSENT_TYPE(ContinuousStates) ABSENT(fmi3SetTime)
ABSENT(fmi3GetNumberOfVariableDependencies) ABSENT(fmi3GetVariableDependencies)
ABSENT(fmi3GetDirectionalDerivative) ABSENT(fmi3GetAdjointDerivative) ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep) ABSENT(fmi3GetContinuousStateDerivatives) ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetNominalsOfContinuousStates) ABSENT(fmi3GetNumberOfEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates) ABSENT(fmi3GetOutputDerivatives) ABSENT(fmi3ActivateModelPartition)
