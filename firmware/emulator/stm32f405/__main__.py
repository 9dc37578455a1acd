"""Runs an image, controlled by lines of JSON: `python -m stm32f405 IMAGE`, see README.md."""

import argparse
import json
import sys

from unicorn import UC_HOOK_CODE, UC_HOOK_MEM_READ
from unicorn.arm_const import UC_ARM_REG_SP

from .chip import FLASH, PORTS, Chip
from .cycles import Model
from .lines import Usart
from .peripherals import TICKS, Rcc

FLAGS = {"": 0, "noise": Usart.NOISE, "framing": Usart.FRAMING, "overrun": Usart.OVERRUN}


def ticks(microseconds):
    return microseconds * TICKS // 1_000_000


class Server:
    """Reads one command per line and writes one answer per line."""

    def __init__(self, chip):
        self.chip = chip

    def send(self, at, port, bytes, error="", at_once=False):
        """Sends bytes to a port, starting at a time (us), each with an error if one is given."""
        self.chip.send(ticks(at), port, __builtins__.bytes.fromhex(bytes), FLAGS[error], at_once)
        return {}

    def run(self, until):
        """Runs until a time (us); returns bytes sent by the ports, and resets."""
        self.chip.run_until(ticks(until))
        events = sorted([*self.chip.left(), *self.chip.log], key=lambda event: event["at"])
        self.chip.log.clear()
        return {"events": events}

    def trace(self, until):
        """Runs until a time (us), counting every cycle by the model of cycles.py; slow."""
        unicorn, model = self.chip.unicorn, Model(self.chip.unicorn.mem_read)
        hooks = [
            unicorn.hook_add(UC_HOOK_CODE, lambda _, address, *__: model.execute(address)),
            unicorn.hook_add(UC_HOOK_MEM_READ, lambda _, __, address, *___: model.read(address), begin=FLASH[0], end=sum(FLASH)),
        ]
        self.chip.run_until(ticks(until))
        for hook in hooks:
            unicorn.hook_del(hook)
        return model.result()

    def provoke(self, kind, within=""):
        """Injects a fault; `within` waits up to a tenth of a second for the processor to be in a task or an interrupt."""
        chip = self.chip
        limit = chip.now + TICKS // 10
        while within and chip.now < limit and bool(chip.active) != (within == "interrupt"):
            chip.step(chip.now + 200)
        return {"address": chip.provoke(kind), "at": chip.microseconds(), "nested": len(chip.active)}

    def power(self, cause, keep_memory=False):
        """Resets by power-on, brown-out or the reset pin."""
        (self.chip.reset if keep_memory else self.chip.power_on)(cause)
        return {}

    def read(self, address, words):
        data = self.chip.unicorn.mem_read(address, 4 * words)
        return {"words": [int.from_bytes(data[4 * i : 4 * i + 4], "little") for i in range(words)]}

    def look(self):
        """Returns counters and configuration of the chip."""
        chip = self.chip
        return {
            "now": chip.microseconds(),
            "instructions": chip.instructions,
            "busy": chip.busy,
            "overruns": [chip.ports[name].overruns for name in PORTS],
            "waiting": [len(chip.ports[name].coming) for name in PORTS],
            "flash_control": chip.devices[0x4002_3C00].read(0),
            "frequency": chip.rcc.frequency(),
            "reset_flags": chip.rcc.read(Rcc.CSR),
            "priorities": {str(irq): chip.priorities[irq] for irq in range(96) if chip.enabled[irq >> 5] >> (irq & 31) & 1},
            "watchdog": {"started": chip.watchdog.started, "fed": chip.watchdog.fed},
            "faults": [[pc, cause] for pc, cause in chip.faults],
            "stack_pointer": chip.unicorn.reg_read(UC_ARM_REG_SP),
            "locked_up": chip.locked_up,
            "pc": chip.pc,
        }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("image")
    parser.add_argument("--cycles", type=float, default=2.3, help="of an instruction, on average")
    parser.add_argument("--no-crystal", action="store_true", help="the crystal does not start")
    parser.add_argument("--seed", type=int, default=0, help="of what power-on leaves in memory, and of the random numbers")
    parser.add_argument("--battery", type=int, default=3900, help="its voltage (mV)")
    options = parser.parse_args()
    server = Server(Chip(options.image, options.cycles, not options.no_crystal, options.seed, options.battery))
    for line in sys.stdin:
        command = json.loads(line)
        answer = getattr(server, command.pop("do"))(**command)
        print(json.dumps(answer), flush=True)


main()
