"""Cycles of a stretch of instructions: those of the Cortex-M4 (DDI0439, table 3-1), and what flash adds (RM0090 3.5).

Flash answers after five wait states, one line of 16 bytes at a time. With the accelerator on, the next line is prefetched,
and 64 lines of instructions and 8 of data are cached. A taken branch refills the pipeline in two cycles (the manual says one
to three); a division takes seven (two to twelve). Bus contention and stalls for results are not modelled.
"""

import collections

import capstone

LINE, WAITS = 16, 5
INSTRUCTION_LINES, DATA_LINES = 64, 8
REFILL, DIVISION = 2, 7
FLASH_END = 0x1000_0000
FLOATING = {"vdiv": 14, "vsqrt": 14, "vmla": 3, "vmls": 3, "vfma": 3, "vfms": 3, "vnmla": 3, "vnmls": 3, "vnmul": 1}
MANY = ("ldm", "stm", "push", "pop", "vldm", "vstm", "vpush", "vpop")


class Lines:
    """Cache of the most recently used lines."""

    def __init__(self, count):
        self.count, self.lines = count, collections.OrderedDict()

    def hit(self, line):
        if line in self.lines:
            self.lines.move_to_end(line)
            return True
        self.lines[line] = None
        if len(self.lines) > self.count:
            self.lines.popitem(last=False)
        return False


class Decoder:
    """Returns the cycles of each instruction without flash, and whether it loads or stores one word."""

    def __init__(self, memory):
        self.memory, self.known = memory, {}
        self.capstone = capstone.Cs(capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS)

    def of(self, address):
        found = self.known.get(address)
        if found is None:
            found = self.known[address] = self.decode(address)
        return found

    def decode(self, address):
        for instruction in self.capstone.disasm(bytes(self.memory(address, 4)), address, 1):
            return self.cost(instruction) + (instruction.size,)
        return 1, False, 2

    def cost(self, instruction):
        name = instruction.mnemonic.split(".")[0]
        if name.startswith(MANY):
            registers = instruction.op_str.split("{")[-1].count(",") + 1
            return 1 + registers, False
        if name.startswith(("ldrd", "strd")):
            return 3, False
        if name.startswith(("ldr", "vldr", "ldrex")):
            return 2, True
        if name.startswith(("str", "vstr")):
            return 1 if name.startswith("str") else 2, True
        if name.startswith(("udiv", "sdiv")):
            return DIVISION, False
        for start, cycles in FLOATING.items():
            if name.startswith(start):
                return cycles, False
        return 1, False


class Model:
    """Counts instructions, their cycles, and the waits for flash with and without the accelerator."""

    def __init__(self, memory):
        self.decoder = Decoder(memory)
        self.instructions = self.cycles = 0
        self.waits = {"plain": 0, "accelerated": 0}
        self.cached, self.data = Lines(INSTRUCTION_LINES), Lines(DATA_LINES)
        self.line = None
        self.follows, self.single = None, False
        self.in_line = 0

    def execute(self, address):
        cycles, single, size = self.decoder.of(address)
        if single and self.single:
            # Consecutive loads and stores of one word overlap.
            cycles -= cycles > 1
        taken = self.follows is not None and address != self.follows
        if taken:
            cycles += REFILL
        self.fetch(address // LINE, taken, address)
        self.instructions += 1
        self.cycles += cycles
        self.in_line += cycles
        self.follows, self.single = address + size, single

    def fetch(self, line, taken, address):
        if line == self.line or address >= FLASH_END:
            return
        self.waits["plain"] += WAITS
        if line == (self.line or 0) + 1 and not taken:
            if not self.cached.hit(line):
                self.waits["accelerated"] += max(0, WAITS - self.in_line)
        elif not self.cached.hit(line):
            self.waits["accelerated"] += WAITS
        self.line, self.in_line = line, 0

    def read(self, address):
        line = address // LINE
        self.waits["plain"] += WAITS
        if not self.data.hit(line):
            self.waits["accelerated"] += WAITS

    def result(self):
        return {
            "instructions": self.instructions,
            "cycles": self.cycles,
            "plain": self.cycles + self.waits["plain"],
            "accelerated": self.cycles + self.waits["accelerated"],
        }
