"""The serial lines of the STM32F405: USART with direct memory access, after the reference manual RM0090 [10, 30].

Bytes come and go at the rate of the line. Under direct memory access they are moved only when something reads them, which
makes no difference to the processor and is much faster here.
"""

import collections

from .peripherals import NEVER


class Dma:
    """A controller of eight streams [10]. A transfer takes no time."""

    COUNT = 8
    # Bits of a stream in the flag registers, and of each flag.
    SHIFT = (0, 6, 16, 22)
    HALF, COMPLETE = 0x10, 0x20
    FIELDS = ("cr", "ndtr", "par", "m0ar", "m1ar", "fcr")

    def __init__(self, chip, interrupts):
        self.chip, self.interrupts = chip, interrupts
        self.streams = [
            dict(cr=0, ndtr=0, par=0, m0ar=0, m1ar=0, fcr=0x21, flags=0, index=0, length=0)
            for _ in range(self.COUNT)
        ]

    def read(self, offset):
        self.chip.advance_lines()
        if offset < 8:
            return sum(self.streams[offset + place]["flags"] << self.SHIFT[place] for place in range(4))
        if offset < 0x10:
            return 0
        stream, register = divmod(offset - 0x10, 0x18)
        return self.streams[stream][self.FIELDS[register // 4]] if stream < self.COUNT else 0

    def write(self, offset, value):
        self.chip.advance_lines()
        if offset in (8, 12):
            for place in range(4):
                self.streams[offset - 8 + place]["flags"] &= ~(value >> self.SHIFT[place] & 0x3D)
        elif offset >= 0x10:
            number, register = divmod(offset - 0x10, 0x18)
            stream, field = self.streams[number], self.FIELDS[register // 4]
            if field == "cr" and value & 1 and not stream["cr"] & 1:
                # The count is reloaded with the value written last [10.5.6].
                stream["index"], stream["ndtr"] = 0, stream["length"]
            elif field == "cr" and stream["cr"] & 1 and not value & 1:
                # Disabling a stream counts as its end [10.3.17].
                stream["flags"] |= self.COMPLETE
            if field == "ndtr":
                stream["length"] = value
            stream[field] = value

    def find(self, peripheral, towards_peripheral):
        for stream in self.streams:
            ready = stream["cr"] & 1 and stream["ndtr"]
            if ready and stream["par"] == peripheral and (stream["cr"] >> 6 & 3) == towards_peripheral:
                return stream
        return None

    def step(self, stream):
        """Moves one byte; returns its address in memory."""
        address = stream["m0ar"] + stream["index"]
        stream["index"] += 1
        stream["ndtr"] -= 1
        if stream["ndtr"] == stream["length"] // 2:
            stream["flags"] |= self.HALF
        if stream["ndtr"] == 0:
            stream["flags"] |= self.COMPLETE
            if stream["cr"] & 0x100:
                stream["ndtr"], stream["index"] = stream["length"], 0
            else:
                stream["cr"] &= ~1
        return address

    def until_flag(self, stream):
        """Number of bytes until a flag that raises an interrupt."""
        waits = [stream["ndtr"]] if stream["cr"] & 0x10 else []
        half = stream["length"] // 2
        if stream["cr"] & 8 and stream["ndtr"] > half:
            waits.append(stream["ndtr"] - half)
        return min(waits, default=None)

    def levels(self):
        for number, stream in enumerate(self.streams):
            if stream["flags"] & (stream["cr"] << 1) & 0x38:
                yield self.interrupts[number]


class Usart:
    """A serial line [30]: 8 data bits, no parity, 1 stop bit."""

    SR, DR, BRR, CR1, CR3 = 0x00, 0x04, 0x08, 0x0C, 0x14
    FRAMING, NOISE, OVERRUN, IDLE, RECEIVED, SENT, EMPTY = (1 << bit for bit in (1, 2, 3, 4, 5, 6, 7))
    ERRORS = FRAMING | NOISE | OVERRUN

    def __init__(self, chip, base, interrupt, dma, divider):
        self.chip, self.base, self.interrupt, self.dma, self.divider = chip, base, interrupt, dma, divider
        self.registers = {}
        self.flags, self.data = self.SENT | self.EMPTY, 0
        self.coming = collections.deque()
        self.last_coming = 0
        self.idle_at = NEVER
        self.sent_at = NEVER
        self.left = []
        self.overruns = 0

    def byte_time(self):
        return (self.registers.get(self.BRR, 0) or 1) * 10 * self.divider

    def feed(self, at, data, flags=0, at_once=False):
        """Receives bytes from time `at` on, with error flags; with `at_once` they may overlap bytes already arriving."""
        time = at if at_once else max(at, self.last_coming)
        for byte in data:
            time += self.byte_time()
            self.coming.append((time, byte, flags))
        if at_once:
            self.coming = collections.deque(sorted(self.coming))
        self.last_coming = max(time, self.last_coming)

    def receiving(self):
        return self.registers.get(self.CR1, 0) & 0x2004 == 0x2004

    def receiver_stream(self):
        return self.dma.find(self.base + 4, 0) if self.registers.get(self.CR3, 0) & 0x40 else None

    def advance(self):
        now = self.chip.now
        if self.sent_at <= now:
            self.transmit()
        while self.coming and self.coming[0][0] <= now:
            time, byte, flags = self.coming.popleft()
            if self.idle_at < time:
                self.flags |= self.IDLE
            self.receive(time, byte, flags)
        if self.idle_at <= now:
            self.flags |= self.IDLE
            self.idle_at = NEVER

    def receive(self, time, byte, flags):
        if not self.receiving():
            return
        self.idle_at = time + self.byte_time()
        if self.flags & self.RECEIVED:
            self.flags |= self.OVERRUN
            self.overruns += 1
            return
        self.flags |= self.RECEIVED | flags
        self.overruns += bool(flags & self.OVERRUN)
        self.data = byte
        self.take()

    def take(self):
        """Moves a received byte by direct memory access."""
        stream = self.receiver_stream() if self.flags & self.RECEIVED else None
        if stream is not None:
            self.chip.store_byte(self.dma.step(stream), self.data)
            self.flags &= ~self.RECEIVED

    def transmit(self):
        """Sends all bytes that are due."""
        while self.sent_at <= self.chip.now:
            stream = self.dma.find(self.base + 4, 1) if self.registers.get(self.CR3, 0) & 0x80 else None
            if stream is None:
                self.flags |= self.SENT | self.EMPTY
                self.sent_at = NEVER
                return
            self.leave(self.sent_at, self.chip.load_byte(self.dma.step(stream)))

    def leave(self, begin, byte):
        self.sent_at = begin + self.byte_time()
        self.left.append((self.sent_at, byte))
        self.flags &= ~self.SENT

    def start_transmitting(self):
        """Wakes a sleeping transmitter if there is something to send."""
        if self.sent_at == NEVER and self.registers.get(self.CR1, 0) & 0x2008 == 0x2008:
            self.sent_at = self.chip.now
            self.transmit()

    def next(self):
        """Time at which the interrupt of the line, or of its direct memory access, may be raised."""
        control, control3 = self.registers.get(self.CR1, 0), self.registers.get(self.CR3, 0)
        time = NEVER
        if self.coming:
            stream = self.receiver_stream()
            if stream is None or control & 0x20:
                time = self.coming[0][0]
            else:
                count = self.dma.until_flag(stream)
                if count is not None and count <= len(self.coming):
                    time = self.coming[count - 1][0]
                time = min(time, self.first_remark(control, control3))
        elif control & 0x10:
            time = min(time, self.idle_at)
        if self.sent_at != NEVER:
            stream = self.dma.find(self.base + 4, 1) if control3 & 0x80 else None
            count = self.dma.until_flag(stream) if stream else None
            if count:
                time = min(time, self.sent_at + (count - 1) * self.byte_time())
            elif stream is None:
                time = min(time, self.sent_at)
        return time

    def first_remark(self, control, control3):
        """The first error or pause among the arriving bytes."""
        pause = self.byte_time()
        previous = self.idle_at - pause if self.idle_at != NEVER else None
        for time, _, flags in self.coming:
            if control & 0x10 and previous is not None and time > previous + pause:
                return previous + pause
            if flags and control3 & 1:
                return time
            previous = time
        return previous + pause

    def level(self):
        flags, control, control3 = self.flags, self.registers.get(self.CR1, 0), self.registers.get(self.CR3, 0)
        asked = flags & control & (self.IDLE | self.RECEIVED | self.SENT | self.EMPTY)
        overrun = flags & self.OVERRUN and control & self.RECEIVED
        errors = flags & self.ERRORS and control3 & 0x41 == 0x41
        return asked or overrun or errors

    def read(self, offset):
        self.advance()
        if offset == self.SR:
            return self.flags
        if offset == self.DR:
            # After a read of SR this clears the errors and the pause too; the unit always reads SR first.
            self.flags &= ~(self.ERRORS | self.IDLE | self.RECEIVED)
            return self.data
        return self.registers.get(offset, 0)

    def write(self, offset, value):
        self.advance()
        if offset == self.SR:
            self.flags &= value | ~(self.SENT | self.RECEIVED)
        elif offset == self.DR:
            self.leave(max(self.chip.now, self.sent_at if self.sent_at != NEVER else 0), value & 0xFF)
        else:
            self.registers[offset] = value
            self.take()
