/* libmodbus on a serial port: `serial_peer client PORT BAUD COUNT` reads 40 registers COUNT times, RTU 8N1;
 * `serial_peer server PORT BAUD` answers as unit 1, register n holding n. */
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int ask(modbus_t *context, long count)
{
    uint16_t words[40];
    long done;

    for (done = 0; done < count; done++)
        if (modbus_read_registers(context, 0, 40, words) != 40)
            return 1;
    return 0;
}

static int serve(modbus_t *context)
{
    modbus_mapping_t *memory = modbus_mapping_new(100, 100, 1000, 100);
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];
    int size, at;

    if (memory == NULL)
        return 1;
    for (at = 0; at < 1000; at++)
        memory->tab_registers[at] = at;
    printf("ready\n");
    fflush(stdout);
    while ((size = modbus_receive(context, request)) >= 0)
        if (size > 0)
            modbus_reply(context, request, size, memory);
    return 0;
}

int main(int argc, char **argv)
{
    modbus_t *context;

    if (argc < 4)
        return 2;
    context = modbus_new_rtu(argv[2], atoi(argv[3]), 'N', 8, 1);
    if (context == NULL || modbus_set_slave(context, 1) < 0 || modbus_connect(context) < 0)
        return 1;
    if (strcmp(argv[1], "server") == 0)
        return serve(context);
    return argc == 5 ? ask(context, atol(argv[4])) : 2;
}
