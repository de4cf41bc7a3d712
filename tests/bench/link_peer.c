/* libmodbus as the yardstick: `link_peer server PORT` answers, `link_peer client PORT COUNT` asks for 40 registers. */
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static int serve(int port)
{
    modbus_t *context = modbus_new_tcp("127.0.0.1", port);
    modbus_mapping_t *memory = modbus_mapping_new(100, 100, 1000, 100);
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    int listener = modbus_tcp_listen(context, 4), size;

    if (listener < 0 || memory == NULL)
        return 1;
    printf("ready\n");
    fflush(stdout);
    for (;;) {
        if (modbus_tcp_accept(context, &listener) < 0)
            return 1;
        while ((size = modbus_receive(context, request)) >= 0)
            if (size > 0)
                modbus_reply(context, request, size, memory);
        modbus_close(context);
    }
}

static int ask(int port, long count)
{
    modbus_t *context = modbus_new_tcp("127.0.0.1", port);
    struct timespec from, to;
    uint16_t words[40];
    long done;

    if (modbus_connect(context) < 0)
        return 1;
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (done = 0; done < count; done++)
        if (modbus_read_registers(context, 0, 40, words) != 40)
            return 1;
    clock_gettime(CLOCK_MONOTONIC, &to);
    printf("%.1f\n", count / ((to.tv_sec - from.tv_sec) + (to.tv_nsec - from.tv_nsec) / 1e9));
    modbus_close(context);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "server") == 0)
        return serve(atoi(argv[2]));
    if (argc == 4 && strcmp(argv[1], "client") == 0)
        return ask(atoi(argv[2]), atol(argv[3]));
    fprintf(stderr, "usage: link_peer server PORT | client PORT COUNT\n");
    return 2;
}
