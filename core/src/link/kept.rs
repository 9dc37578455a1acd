//! Messages about what a unit keeps: its log and its stored configuration.

use super::wire::{body, code};

code! {
    /// An action on the on-board log.
    LogAction {
        /// Read a block
        Read = 0,
        /// Erase the whole log
        Erase = 1,
    }
}

body! {
    /// Host to unit: reads a block of the on-board log, answered by all its [`LogPiece`]s; or erases the log, answered
    /// by the piece of a block that does not exist.
    LogAsk {
        /// Requested action
        action: LogAction = "",
        /// Number of the block, 0 the oldest
        block: u32 = "",
    }
}

code! {
    /// An action on the stored configuration.
    SetupAction {
        /// Store the configuration in use; the unit starts with it from then on
        Store = 0,
        /// Send the stored configuration
        Read = 1,
        /// Forget the stored configuration
        Erase = 2,
    }
}

body! {
    /// Host to unit: stores the configuration in use, reads it back or erases it. Answered by [`Stored`]; when it is
    /// read, [`Configure`](super::Configure) and 16 [`SegmentValues`](super::SegmentValues) come first.
    SetupAsk {
        /// Requested action
        action: SetupAction = "",
    }
}

code! {
    /// State of the stored configuration.
    SetupState {
        /// It is stored
        Present = 0,
        /// Nothing usable is stored
        Absent = 1,
        /// The unit has no storage
        NoStorage = 2,
        /// The storage failed
        Failed = 3,
        /// The unit has no complete configuration to store
        NothingToStore = 4,
    }
}

body! {
    /// Unit to host: answer to [`SetupAsk`].
    Stored {
        /// State after the action
        state: SetupState = "",
        /// CRC-32C over the stored segment table, 0 without one
        table_digest: u32 = "",
    }
}

/// Number of block bytes in one [`LogPiece`].
pub const PIECE_LENGTH: usize = 96;

body! {
    /// Unit to host: a piece of a block of the log.
    LogPiece {
        /// Number of the block, 0 the oldest
        block: u32 = "",
        /// Length of the block, 0 if there is no such block
        length: u16 = "bytes",
        /// Offset of the piece in the block
        offset: u16 = "bytes",
        /// Bytes of the piece, zero beyond the end of the block
        bytes: [u8; 96] = "",
    }
}
