/* A library for LD_PRELOAD: what the kernel's I2C and SPI drivers do in ioctl(), done by a bench.
 *
 * smbus2 and spidev open device files named /dev/i2c-N and /dev/spidevB.D (nodes of /dev/null do) and call ioctl() on
 * them. Here each transfer becomes a request to the bench (tests.system.hil_server) at $WAYFARER_BENCH, and its answer the
 * result. All other device files, and all other calls, are the kernel's own. As from the kernel, a device whose file is
 * gone since it was opened fails with ENODEV (I2C) or ESHUTDOWN (SPI).
 */
#define _GNU_SOURCE
#include <errno.h>
#include <limits.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <linux/spi/spidev.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

enum { LINE = 16384, BYTES = LINE / 2 };

/* -- the bench: one JSON object a line ---------------------------------------------------------------------------- */

static FILE *bench(void)
{
    struct sockaddr_un where = {.sun_family = AF_UNIX};
    const char *path = getenv("WAYFARER_BENCH");
    int line = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    strncpy(where.sun_path, path ? path : "", sizeof where.sun_path - 1);
    if (line >= 0 && connect(line, (struct sockaddr *)&where, sizeof where) == 0)
        return fdopen(line, "r+");
    if (line >= 0)
        close(line);
    errno = ENODEV;
    return NULL;
}

static void say_bytes(FILE *to, const unsigned char *data, size_t count)
{
    for (size_t at = 0; at < count; at++)
        fprintf(to, "%02x", data ? data[at] : 0);
}

/* Take the bench's reply to what was said: its bytes, all pieces in a row. */
static int reply(FILE *from, unsigned char bytes[BYTES])
{
    char line[LINE] = "", *at;

    fflush(from);
    if (!fgets(line, sizeof line, from))
        line[0] = '\0';
    fclose(from);
    if ((at = strstr(line, "\"errno\":"))) {
        errno = atoi(at + strlen("\"errno\":"));
        if (errno)
            return -1;
        fputs(line, stderr); /* a chip was misused: no error of the wire */
    }
    if (at || !(at = strstr(line, "\"data\":["))) {
        errno = EIO;
        return -1;
    }
    for (at += strlen("\"data\":["); *at != ']' && *at != '\0';)
        if (sscanf(at, "%2hhx", bytes) == 1)
            bytes++, at += 2;
        else
            at++; /* a quote, or the comma between two pieces */
    return 0;
}

/* -- I2C: what smbus2 asks for ------------------------------------------------------------------------------------ */

/* A write, a read, or a write and a read after a repeated start. */
static int i2c_transfer(const char *bus, const struct i2c_rdwr_ioctl_data *transfer)
{
    const struct i2c_msg *first = transfer->msgs, *last = first + transfer->nmsgs - 1;
    const struct i2c_msg *writes = first->flags & I2C_M_RD ? NULL : first;
    const struct i2c_msg *reads = last->flags & I2C_M_RD ? last : NULL;
    unsigned char bytes[BYTES];
    FILE *to;

    if ((writes != NULL) + (reads != NULL) != (int)transfer->nmsgs) {
        errno = EOPNOTSUPP;
        return -1;
    }
    if (!(to = bench()))
        return -1;
    fprintf(to, "{\"do\":\"i2c\",\"bus\":\"%s\",\"address\":%d,\"count\":%d,\"data\":[", bus, first->addr,
            reads ? reads->len : 0);
    if (writes) {
        fputc('"', to);
        say_bytes(to, writes->buf, writes->len);
        fputc('"', to);
    }
    fputs("]}\n", to);
    if (reply(to, bytes))
        return -1;
    if (reads)
        memcpy(reads->buf, bytes, reads->len);
    return transfer->nmsgs;
}

static int i2c(const char *bus, unsigned long request, void *argument)
{
    switch (request) {
    case I2C_FUNCS:
        *(unsigned long *)argument = I2C_FUNC_I2C | I2C_FUNC_SMBUS_EMUL;
        return 0;
    case I2C_RDWR:
        return i2c_transfer(bus, argument);
    }
    errno = ENOTTY;
    return -1;
}

/* -- SPI: what spidev asks for ------------------------------------------------------------------------------------ */

/* Several transfers are one period of chip select, unless one asks for a change after it. */
static int spi_transfer(const char *device, const struct spi_ioc_transfer *parts, size_t count)
{
    unsigned char bytes[BYTES], *from = bytes;
    int total = 0;
    FILE *to = bench();

    if (!to)
        return -1;
    fprintf(to, "{\"do\":\"spi\",\"bus\":\"%s\",\"data\":[\"", device);
    for (size_t at = 0; at < count; at++) {
        say_bytes(to, (const unsigned char *)(unsigned long)parts[at].tx_buf, parts[at].len);
        if (parts[at].cs_change && at + 1 < count)
            fputs("\",\"", to);
    }
    fputs("\"]}\n", to);
    if (reply(to, bytes))
        return -1;
    for (size_t at = 0; at < count; from += parts[at].len, total += parts[at].len, at++)
        if (parts[at].rx_buf)
            memcpy((void *)(unsigned long)parts[at].rx_buf, from, parts[at].len);
    return total;
}

static int spi(const char *device, unsigned long request, void *argument)
{
    /* Of the device, as in the kernel, and not of who has it open; one device is enough here. */
    static unsigned mode = SPI_MODE_0, speed_hz = 500000;
    static unsigned char bits = 8;

    switch (request) {
    case SPI_IOC_RD_MODE: *(unsigned char *)argument = mode; return 0;
    case SPI_IOC_WR_MODE: mode = *(unsigned char *)argument; return 0;
    case SPI_IOC_RD_MODE32: *(unsigned *)argument = mode; return 0;
    case SPI_IOC_WR_MODE32: mode = *(unsigned *)argument; return 0;
    case SPI_IOC_RD_BITS_PER_WORD: *(unsigned char *)argument = bits; return 0;
    case SPI_IOC_WR_BITS_PER_WORD: bits = *(unsigned char *)argument; return 0;
    case SPI_IOC_RD_MAX_SPEED_HZ: *(unsigned *)argument = speed_hz; return 0;
    case SPI_IOC_WR_MAX_SPEED_HZ: speed_hz = *(unsigned *)argument; return 0;
    }
    if (_IOC_TYPE(request) == SPI_IOC_MAGIC && _IOC_NR(request) == 0)
        return spi_transfer(device, argument, _IOC_SIZE(request) / sizeof(struct spi_ioc_transfer));
    errno = ENOTTY;
    return -1;
}

/* -- the call itself ---------------------------------------------------------------------------------------------- */

static int starts_with(const char *text, const char *start)
{
    return strncmp(text, start, strlen(start)) == 0;
}

int ioctl(int file, unsigned long request, ...)
{
    char link[32], name[PATH_MAX] = "";
    void *argument;
    va_list rest;

    va_start(rest, request);
    argument = va_arg(rest, void *);
    va_end(rest);
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    if (readlink(link, name, sizeof name - 1) < 0 || !(starts_with(name, "/dev/i2c-") || starts_with(name, "/dev/spidev")))
        return syscall(SYS_ioctl, file, request, argument);
    if (strstr(name, " (deleted)")) {
        errno = starts_with(name, "/dev/i2c-") ? ENODEV : ESHUTDOWN;
        return -1;
    }
    return (starts_with(name, "/dev/i2c-") ? i2c : spi)(name, request, argument);
}
