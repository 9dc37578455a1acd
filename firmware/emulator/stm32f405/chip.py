"""The STM32F405 as a whole: memories, the map of its peripherals, time, resets, and fault injection."""

import collections
import heapq
import itertools
import random
import struct

from elftools.elf.elffile import ELFFile
from unicorn import UC_HOOK_MEM_INVALID, UC_PROT_ALL, UC_PROT_EXEC, UC_PROT_READ

from . import processor as cpu
from .flash import Nothing, Port, SerialFlash, Spi
from .lines import Dma, Usart
from .peripherals import NEVER, TICKS, Converter, Random, Rcc, Registers, Timer, Usb, Watchdog

FLASH, CCM, RAM = (0x0800_0000, 0x10_0000), (0x1000_0000, 0x1_0000), (0x2000_0000, 0x2_0000)
# Not used by any image; code for injected faults is placed here.
SCRATCH = 0x080F_FF00
# Instructions between updates of the peripherals: few after the processor slept, since Unicorn does not report how many
# it ran before it sleeps again.
SHORTEST_SLICE, LONGEST_SLICE = 60, 1000
PORTS = ("host", "sensor")


class Chip(cpu.Processor):
    """A chip with an image in its flash."""

    def __init__(self, image, cycles=2.3, crystal=True, seed=0, battery=3900):
        super().__init__()
        self.cycles, self.crystal, self.battery = cycles, crystal, battery
        self.random = random.Random(seed)
        self.now = 0
        self.flash = SerialFlash(self)
        self.sends, self.numbers = [], itertools.count()
        self.log = []
        self.instructions = self.busy = 0
        unicorn = self.unicorn
        unicorn.mem_map(*FLASH, UC_PROT_READ | UC_PROT_EXEC)
        for memory in (CCM, RAM):
            # The core-coupled memory holds no instructions [2.3.1].
            unicorn.mem_map(*memory, UC_PROT_ALL if memory == RAM else UC_PROT_ALL & ~UC_PROT_EXEC)
        unicorn.mmio_map(0x4000_0000, 0x8_0000, self.read, 0x4000_0000, self.write, 0x4000_0000)
        unicorn.mmio_map(0x5000_0000, 0x4_0000, self.read, 0x5000_0000, self.write, 0x5000_0000)
        unicorn.mmio_map(0x5006_0000, 0x1000, self.read, 0x5006_0000, self.write, 0x5006_0000)
        unicorn.mmio_map(0xE000_0000, 0x10_0000, self.read_private, None, self.write_private, None)
        unicorn.hook_add(UC_HOOK_MEM_INVALID, self.on_invalid)
        self.bad_address = None
        self.slice = SHORTEST_SLICE
        self.load(image)
        self.power_on()

    def load(self, image):
        with open(image, "rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    self.unicorn.mem_write(segment["p_paddr"], segment.data())
                    if segment["p_flags"] & 1:
                        self.watch(segment["p_paddr"], segment.data())
            table = elf.get_section_by_name(".symtab")
            self.symbols = {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()}

    # Power and resets.

    def power_on(self, cause="power-on"):
        """Fills memory with the random contents of power-on."""
        for begin, length in (CCM, RAM):
            self.unicorn.mem_write(begin, self.random.randbytes(length))
        self.reset(cause)

    def reset(self, cause):
        self.log.append({"at": self.microseconds(), "reset": cause})
        # Flags stay until software clears them [7.3.21].
        old = 0 if cause == "power-on" or not hasattr(self, "rcc") else self.rcc.read(Rcc.CSR) & 0xFE00_0000
        self.rcc = Rcc(old | Rcc.CAUSES[cause], self.crystal)
        self.flash.power_on()
        self.timer = Timer(self, 28)
        self.watchdog = Watchdog(self)
        controllers = [Dma(self, (11, 12, 13, 14, 15, 16, 17, 47)), Dma(self, (56, 57, 58, 59, 60, 68, 69, 70))]
        self.controllers = controllers
        self.ports = {
            "host": Usart(self, 0x4000_4800, 39, controllers[0], 4),
            "sensor": Usart(self, 0x4001_1400, 71, controllers[1], 2),
        }
        self.devices = {
            0x4000_0000: self.timer,
            0x4000_3000: self.watchdog,
            0x4000_3800: Spi(Nothing()),
            0x4000_3C00: Spi(self.flash),
            0x4000_4800: self.ports["host"],
            0x4001_1400: self.ports["sensor"],
            0x4000_7000: Registers({4: 0x4000}),
            0x4001_2000: Converter(self.battery),
            0x4002_0000: Port(15, self.flash.select),
            0x4002_3800: self.rcc,
            0x4002_3C00: Registers(),
            0x4002_6000: controllers[0],
            0x4002_6400: controllers[1],
            0x5000_0000: Usb(),
            0x5006_0800: Random(self.random),
        }
        self.demcr, self.counter, self.counter_since = 0, 0, self.now
        self.tick = TICKS // Rcc.HSI
        self.restart()

    # Memory and registers.

    def store_byte(self, address, byte):
        self.unicorn.mem_write(address, bytes([byte]))

    def load_byte(self, address):
        return self.unicorn.mem_read(address, 1)[0]

    def device(self, address):
        return self.devices.setdefault(address & ~0x3FF, Registers())

    def read(self, _, offset, size, base):
        address = base + offset
        word = self.device(address).read(address & 0x3FC)
        return word >> 8 * (address & 3) & (1 << 8 * size) - 1

    def write(self, _, offset, size, value, base):
        address = base + offset
        self.device(address).write(address & 0x3FC, value)
        if self.device(address) is self.rcc:
            self.tick = TICKS // max(1, self.rcc.frequency())

    def read_private(self, _, offset, size, __):
        address = 0xE000_0000 + offset
        if address == 0xE000_1004:
            return self.cycle_count()
        if address == 0xE000_1000:
            return 0x4000_0000 | self.counter
        if address == 0xE000_EDFC:
            return self.demcr
        if 0xE000_E100 <= address < 0xE000_E10C or 0xE000_E180 <= address < 0xE000_E18C:
            return self.enabled[(address & 0xC) >> 2]
        if 0xE000_E400 <= address < 0xE000_E460:
            return int.from_bytes(self.priorities[address - 0xE000_E400 :][:size], "little")
        if address == 0xE000_ED00:
            return 0x410F_C241
        if address == 0xE000_ED04:
            return self.active[-1] if self.active else 0
        return self.system.get(address, 0)

    def write_private(self, _, offset, size, value, __):
        address = 0xE000_0000 + offset
        words, place = 0xE000_E100 <= address < 0xE000_E300, (address & 0x1C) >> 2
        bits = [32 * place + bit for bit in range(32) if value >> bit & 1] if words else []
        if words and place < 3:
            block = address & 0x380
            if block == 0x100:
                self.enabled[place] |= value
            elif block == 0x180:
                self.enabled[place] &= ~value
            elif block == 0x200:
                self.software_pending.update(bits)
            elif block == 0x280:
                self.software_pending.difference_update(bits)
        elif 0xE000_E400 <= address < 0xE000_E460:
            # Four bits of priority.
            masked = bytes(byte & 0xF0 for byte in value.to_bytes(size, "little"))
            self.priorities[address - 0xE000_E400 : address - 0xE000_E400 + size] = masked
        elif address == cpu.AIRCR:
            if value >> 16 == 0x05FA and value & 4:
                self.stop = ("reset", "software")
                self.unicorn.emu_stop()
        elif address in (cpu.CFSR, cpu.HFSR):
            self.system[address] = self.system.get(address, 0) & ~value
        elif address == 0xE000_1000:
            self.counter_since = self.now - self.counter_ticks()
            self.counter = value & 1
        elif address == 0xE000_1004:
            self.counter_since = self.now - value
        elif address == 0xE000_EDFC:
            self.demcr = value
        else:
            self.system[address] = value

    def counter_ticks(self):
        return self.now - self.counter_since if self.counter else 0

    def cycle_count(self):
        return self.counter_ticks() & 0xFFFF_FFFF if self.demcr >> 24 & 1 else 0

    def on_invalid(self, _, __, address, ___, ____, _____):
        self.bad_address = address
        return False

    # Time.

    def microseconds(self):
        return self.now * 1_000_000 // TICKS

    def charge(self, cycles):
        self.now += int(cycles) * self.tick
        self.busy += int(cycles)

    def advance_lines(self):
        for port in self.ports.values():
            port.advance()

    def levels(self):
        found = [device.interrupt for device in (self.timer, *self.ports.values()) if device.level()]
        for controller in self.controllers:
            found.extend(controller.levels())
        return found

    def next_change(self):
        times = [self.timer.next(), self.watchdog.bites, self.sends[0][0] if self.sends else NEVER]
        times.extend(port.next() for port in self.ports.values())
        return min(times)

    def send(self, at, port, data, flags, at_once):
        """Sends bytes to a port, starting at a time (ticks)."""
        heapq.heappush(self.sends, (at, next(self.numbers), port, data, flags, at_once))

    def left(self):
        """Returns the bytes sent, with the port and the time (us) of the last byte of each piece."""
        for name, port in self.ports.items():
            pieces = collections.deque()
            for at, byte in port.left:
                if pieces and at - pieces[-1][0] <= 2 * port.byte_time():
                    pieces[-1] = (at, pieces[-1][1] + bytes([byte]))
                else:
                    pieces.append((at, bytes([byte])))
            port.left.clear()
            for at, data in pieces:
                yield {"at": at * 1_000_000 // TICKS, "port": name, "sent": data.hex()}

    def step(self, limit):
        """Runs one slice: updates the peripherals, then runs the processor until the next possible event."""
        while self.sends and self.sends[0][0] <= self.now:
            at, _, port, data, flags, at_once = heapq.heappop(self.sends)
            self.ports[port].feed(at, data, flags, at_once)
        self.timer.advance()
        self.advance_lines()
        for port in self.ports.values():
            if port.sent_at == NEVER and port.dma.find(port.base + 4, 1):
                port.start_transmitting()
        if self.now >= self.watchdog.bites:
            self.reset("watchdog")
        levels = self.levels()
        if not self.locked_up:
            self.take(levels)
            if self.asleep and self.wanted(levels):
                self.asleep = False
        span = min(self.next_change(), limit) - self.now
        if self.asleep or self.locked_up:
            self.now += max(span, 1)
            return
        count = min(max(int(span / (self.cycles * self.tick)), 1), self.slice)
        executed = self.run(count)
        self.slice = SHORTEST_SLICE if self.stop else min(2 * self.slice, LONGEST_SLICE)
        self.instructions += executed
        self.charge(executed * self.cycles)
        if self.stop == ("reset", "software"):
            self.reset("software")

    def run_until(self, limit):
        while self.now < limit:
            self.step(limit)

    # Fault injection.

    def provoke(self, kind, argument=0):
        """Injects a fault now; returns its address."""
        code = {
            "undefined": b"\x00\xde",
            "bus": b"\x01\x68",
            "division": b"\xb0\xfb\xf1\xf0",
            "unaligned": b"\xd0\xe9\x00\x12",
            "hang": cpu.SELF_BRANCH,
        }
        write = self.unicorn.reg_write
        if kind == "panic":
            return self.panic()
        if kind == "stack":
            # A frame that begins in the last bytes of the stack and pushes more than fits.
            write(cpu.arm.UC_ARM_REG_SP, self.symbols["_stack_end"] + 8)
            code = {"stack": b"\x2d\xe9\xf0\x4f"}
        write(cpu.arm.UC_ARM_REG_R0, {"bus": 0x6000_0000, "unaligned": RAM[0] + 2}.get(kind, 1))
        write(cpu.arm.UC_ARM_REG_R1, 0)
        self.unicorn.mem_write(SCRATCH, code[kind] + cpu.SELF_BRANCH)
        self.unicorn.ctl_remove_cache(SCRATCH, SCRATCH + 0x10)
        cause = {"division": cpu.DIVISION, "unaligned": cpu.UNALIGNED}.get(kind)
        self.traps.pop(SCRATCH, None)
        if cause is not None:
            if not hasattr(self, "scratch_hook"):
                self.scratch_hook = True
                self.trap(SCRATCH, cause)
            self.traps[SCRATCH] = cause
        self.pc = SCRATCH
        self.asleep = False
        return SCRATCH

    def panic(self):
        """Panics as if line 1234 of a file had indexed past the end of its array."""
        name = next(name for name in self.symbols if "panic_bounds_check" in name)
        place, file = SCRATCH + 0x40, b"firmware/src/provoked.rs"
        self.unicorn.mem_write(place, struct.pack("<IIII", place + 16, len(file), 1234, 5) + file)
        for register, value in enumerate((7, 3, place)):
            self.unicorn.reg_write(cpu.arm.UC_ARM_REG_R0 + register, value)
        self.pc = self.symbols[name] & ~1
        self.asleep = False
        return 0
