"""Peripherals of the STM32F405 as far as the unit uses them, after the reference manual RM0090 (sections in brackets).

Time is counted in ticks of 1/168 MHz. A peripheral has `read` and `write` for its registers, `level` for its interrupt line,
`next` for the time at which that line may change by itself, and `advance` to bring it to the present.
"""

TICKS = 168_000_000
NEVER = 1 << 62


class Registers:
    """Registers that read back what was written."""

    def __init__(self, values=None):
        self.values = dict(values or {})

    def read(self, offset):
        return self.values.get(offset, 0)

    def write(self, offset, value):
        self.values[offset] = value


class Rcc(Registers):
    """Reset and clock control [7]. Oscillators are ready as soon as they are on; a crystal may be missing."""

    CR, PLLCFGR, CFGR, BDCR, CSR = 0x00, 0x04, 0x08, 0x70, 0x74
    CRYSTAL = 12_000_000
    HSI = 16_000_000
    # Flags of CSR [7.3.21].
    BROWN_OUT, PIN, POWER, SOFTWARE, WATCHDOG = (1 << bit for bit in (25, 26, 27, 28, 29))
    CAUSES = {
        "power-on": POWER | BROWN_OUT | PIN,
        "brown-out": BROWN_OUT | PIN,
        "pin": PIN,
        "software": SOFTWARE | PIN,
        "watchdog": WATCHDOG | PIN,
    }

    def __init__(self, csr, crystal):
        super().__init__({self.CR: 0x83, self.PLLCFGR: 0x24003010, self.CSR: csr})
        self.crystal = crystal

    def write(self, offset, value):
        if offset == self.CR:
            ready = {0: True, 16: self.crystal, 24: self.pll_input() > 0}
            for on, works in ready.items():
                follows = value >> on & 1 and works
                value = value | 2 << on if follows else value & ~(2 << on)
        elif offset == self.CFGR:
            value = value & ~0xC | (value & 3) << 2
        elif offset == self.CSR:
            value = value & 1 | (value & 1) << 1 | (0 if value >> 24 & 1 else self.read(self.CSR) & 0xFE00_0000)
        elif offset == self.BDCR:
            value = value & ~2 | (value & 1) << 1
        self.values[offset] = value

    def pll_input(self):
        if self.read(self.PLLCFGR) >> 22 & 1:
            return self.CRYSTAL if self.crystal else 0
        return self.HSI

    def frequency(self):
        """Clock frequency of the processor (Hz)."""
        source = self.read(self.CFGR) & 3
        if source == 0:
            return self.HSI
        if source == 1:
            return self.CRYSTAL
        pll = self.read(self.PLLCFGR)
        return self.pll_input() // (pll & 0x3F) * (pll >> 6 & 0x1FF) // (2 * (pll >> 16 & 3) + 2)


class Timer:
    """A general purpose timer that counts up, at 84 MHz before its prescaler [18]."""

    CR1, DIER, SR, EGR, CNT, PSC, ARR, CCR1 = 0x00, 0x0C, 0x10, 0x14, 0x24, 0x28, 0x2C, 0x34

    def __init__(self, chip, interrupt):
        self.chip, self.interrupt = chip, interrupt
        self.registers = {self.ARR: 0xFFFF_FFFF}
        self.flags = 0
        self.count, self.since = 0, 0
        self.prescaler = 0

    def running(self):
        return self.registers.get(self.CR1, 0) & 1

    def period(self):
        return self.registers[self.ARR] + 1

    def compare(self, channel):
        return self.registers.get(self.CCR1 + 4 * channel, 0)

    def tick(self):
        return 2 * (self.prescaler + 1)

    def advance(self):
        if not self.running():
            return
        passed = (self.chip.now - self.since) // self.tick()
        if passed == 0:
            return
        self.since += passed * self.tick()
        old, new, period = self.count, self.count + passed, self.period()
        if new // period > old // period:
            self.flags |= 1
            self.prescaler = self.registers.get(self.PSC, 0)
        for channel in range(4):
            if (new - self.compare(channel)) // period > (old - self.compare(channel)) // period:
                self.flags |= 2 << channel
        self.count = new % period

    def next(self):
        enabled = self.registers.get(self.DIER, 0)
        if not self.running() or not enabled & 0x1F:
            return NEVER
        self.advance()
        period = self.period()
        waits = [period - self.count] if enabled & 1 else []
        for channel in range(4):
            if enabled >> channel & 2:
                waits.append((self.compare(channel) - self.count) % period or period)
        return self.since + min(waits) * self.tick()

    def level(self):
        return self.flags & self.registers.get(self.DIER, 0) & 0x5F

    def read(self, offset):
        self.advance()
        if offset == self.CNT:
            return self.count
        return self.flags if offset == self.SR else self.registers.get(offset, 0)

    def write(self, offset, value):
        self.advance()
        if offset == self.SR:
            self.flags &= value
        elif offset == self.CNT:
            self.count, self.since = value, self.chip.now
        elif offset == self.EGR:
            self.count, self.since = 0, self.chip.now
            self.prescaler = self.registers.get(self.PSC, 0)
            # An update by software raises no interrupt if only overflows are enabled [18.4.1].
            self.flags |= 0 if self.registers.get(self.CR1, 0) & 4 else 1
        else:
            if offset == self.CR1 and value & 1 and not self.running():
                self.since = self.chip.now
            self.registers[offset] = value


class Watchdog:
    """The independent watchdog [21]: its oscillator runs at 32 kHz; once started only a reset stops it."""

    KR, PR, RLR = 0x00, 0x04, 0x08

    def __init__(self, chip):
        self.chip = chip
        self.registers = {self.PR: 0, self.RLR: 0xFFF}
        self.locked, self.started, self.bites = True, False, NEVER
        self.fed = 0

    def read(self, offset):
        return self.registers.get(offset, 0)

    def write(self, offset, value):
        if offset == self.KR:
            self.locked = value != 0x5555
            self.started |= value == 0xCCCC
            if value in (0xAAAA, 0xCCCC) and self.started:
                self.fed += value == 0xAAAA
                period = (4 << self.registers[self.PR]) * (self.registers[self.RLR] + 1)
                self.bites = self.chip.now + period * TICKS // 32_000
        elif not self.locked:
            self.registers[offset] = value


class Converter(Registers):
    """ADC1 [13]: a conversion started by software finishes at once; it reads half the voltage of the battery, at 3.3 V."""

    SR, CR2, DR = 0x00, 0x08, 0x4C
    STARTED, DONE, ON, START = 1 << 4, 1 << 1, 1 << 0, 1 << 30

    def __init__(self, millivolts):
        super().__init__()
        self.count = min(4095, millivolts * 4095 // (2 * 3300))

    def read(self, offset):
        if offset == self.DR:
            # Reading it clears the flag [13.13.1].
            self.values[self.SR] = self.values.get(self.SR, 0) & ~self.DONE
            return self.count
        return super().read(offset)

    def write(self, offset, value):
        if offset == self.SR:
            # Flags are cleared by zeros.
            value &= self.values.get(self.SR, 0)
        elif offset == self.CR2 and value & self.START:
            if value & self.ON:
                self.values[self.SR] = self.values.get(self.SR, 0) | self.STARTED | self.DONE
            value &= ~self.START
        super().write(offset, value)


class Usb(Registers):
    """USB OTG FS [34] without a host: its core is idle, its FIFOs are empty, and there are never data or interrupts."""

    GOTGINT, GRSTCTL, GINTSTS, CID = 0x04, 0x10, 0x14, 0x3C
    IDLE, REQUESTS = 1 << 31, 0x33

    def __init__(self):
        super().__init__({self.GRSTCTL: self.IDLE, self.CID: 0x1200})

    def write(self, offset, value):
        if offset == self.GRSTCTL:
            value = value & ~self.REQUESTS | self.IDLE
        elif offset in (self.GOTGINT, self.GINTSTS, self.CID):
            # Flags are cleared by ones.
            return
        super().write(offset, value)


class Random(Registers):
    """The random number generator [24], replaced by a seeded generator."""

    CR, SR, DR = 0x00, 0x04, 0x08

    def __init__(self, generator):
        super().__init__()
        self.generator = generator

    def read(self, offset):
        if offset == self.SR:
            return self.values.get(self.CR, 0) >> 2 & 1
        if offset == self.DR:
            return self.generator.getrandbits(32)
        return super().read(offset)
