"""The memory chip beside the STM32F405 on a Feather: a GD25Q16 of 2 MiB on SPI3, after its data sheet (commands in table 2).

Time is counted in ticks of 1/168 MHz. Its contents survive a loss of power.
"""

from .peripherals import TICKS, Registers

BYTES, SECTOR, PAGE = 2 << 20, 4096, 256
READ, PROGRAM, ERASE, STATUS, ENABLE, IDENTIFY = 0x03, 0x02, 0x20, 0x05, 0x06, 0x9F
IDENTITY = (0xC8, 0x40, 0x15)
# Typical times (s).
WRITING, ERASING = 0.6e-3, 45e-3


class SerialFlash:
    def __init__(self, chip):
        self.chip = chip
        self.cells = bytearray(b"\xff") * BYTES
        self.selected, self.heard = False, bytearray()
        self.writable, self.busy_until = False, 0

    def power_on(self):
        """Completes a pending write; other tests cover power loss during a write."""
        self.selected, self.writable, self.busy_until = False, False, 0
        self.heard.clear()

    def select(self, selected):
        if self.selected and not selected:
            self.execute()
        if selected and not self.selected:
            self.heard.clear()
        self.selected = selected

    def address(self):
        return int.from_bytes(self.heard[1:4], "big") % BYTES

    def exchange(self, byte):
        """Exchanges one byte."""
        if not self.selected:
            return 0xFF
        self.heard.append(byte)
        place, command = len(self.heard), self.heard[0]
        if command == STATUS and place > 1:
            return (self.chip.now < self.busy_until) | self.writable << 1
        if self.chip.now < self.busy_until:
            return 0xFF
        if command == READ and place > 4:
            return self.cells[(self.address() + place - 5) % BYTES]
        if command == IDENTIFY and 1 < place < 5:
            return IDENTITY[place - 2]
        return 0xFF

    def execute(self):
        if not self.heard or self.chip.now < self.busy_until:
            return
        command, address = self.heard[0], self.address()
        if command == ENABLE:
            self.writable = True
        elif command == PROGRAM and self.writable:
            page = address - address % PAGE
            for place, byte in enumerate(self.heard[4:]):
                self.cells[page + (address + place) % PAGE] &= byte
            self.begin(WRITING)
        elif command == ERASE and self.writable:
            sector = address - address % SECTOR
            self.cells[sector : sector + SECTOR] = b"\xff" * SECTOR
            self.begin(ERASING)

    def begin(self, seconds):
        self.writable, self.busy_until = False, self.chip.now + int(seconds * TICKS)


class Nothing:
    """A bus on which no chip answers: its line is pulled up."""

    def exchange(self, _):
        return 0xFF


class Spi(Registers):
    """SPI in full duplex [28.3]: bytes take no time; flags are those after each byte."""

    SR, DR = 0x08, 0x0C
    RECEIVED, EMPTY = 1 << 0, 1 << 1

    def __init__(self, flash):
        super().__init__({self.SR: self.EMPTY})
        self.flash = flash

    def read(self, offset):
        if offset == self.DR:
            self.values[self.SR] &= ~self.RECEIVED
        return super().read(offset)

    def write(self, offset, value):
        if offset == self.DR:
            value = self.flash.exchange(value & 0xFF)
            self.values[self.SR] |= self.RECEIVED
        elif offset == self.SR:
            return
        super().write(offset, value)


class Port(Registers):
    """A port of pins [8.4] of which one selects a chip: bits are set and reset by BSRR."""

    ODR, BSRR = 0x14, 0x18

    def __init__(self, pin, selected):
        super().__init__()
        self.pin, self.selected = pin, selected

    def write(self, offset, value):
        if offset == self.BSRR:
            offset, value = self.ODR, self.read(self.ODR) & ~(value >> 16) | value & 0xFFFF
        super().write(offset, value)
        if offset == self.ODR:
            self.selected(not value >> self.pin & 1)
