//! The stored configuration: what makes the unit start on its own.

use bodyflight_core::link::{Setup, SetupAction, SetupState, Stored, StreamMode};

use super::state::Unit;
use crate::board::Board;

impl<B: Board> Unit<B> {
    /// Starts a session on the unit's own sensor with a stored configuration, without a host. Returns whether the
    /// configuration was accepted; otherwise the unit waits for a host.
    pub fn resume(&mut self, setup: &Setup) -> bool {
        self.table = setup.table;
        self.sensor.limbs_mut().set_table(&setup.limbs);
        self.configure(setup.configure);
        if self.computer.configuration().is_none() {
            return false;
        }
        // Differs from start to start, so that a host never takes one session for another.
        let [low, high, ..] = self.identity.boot_id.to_le_bytes();
        self.start(u16::from_le_bytes([low, high]), StreamMode::Sensor);
        true
    }

    /// Begins a new calibration of the sensors on the limbs.
    pub fn calibrate(&mut self) {
        self.sensor.limbs_mut().calibrate();
        let answer = self.sensor.limbs().calibration();
        self.send(self.board.now(), answer);
    }

    /// Tells the host and the light how a calibration goes on, and stores one that has ended well.
    pub(super) fn follow_calibration(&mut self) {
        let Some(news) = self.sensor.limbs_mut().news() else {
            return;
        };
        self.light.see_calibration(news.stage, news.verdict);
        if self.greeted {
            self.send(self.board.now(), news);
        }
        if self.sensor.limbs_mut().is_to_store() && self.board.recorder().is_some() {
            self.ask_setup(SetupAction::Store);
        }
    }

    pub(super) fn ask_setup(&mut self, action: SetupAction) {
        let Some(recorder) = self.board.recorder() else {
            self.answer_setup(SetupState::NoStorage, None);
            return;
        };
        let record = match (action, self.asked) {
            (SetupAction::Store, Some(configure)) if self.computer.configuration().is_some() => {
                let (table, limbs) = (self.table, *self.sensor.limbs().table());
                let setup = Setup {
                    configure,
                    table,
                    limbs,
                };
                setup.encode()
            }
            _ => None,
        };
        if action == SetupAction::Store && record.is_none() {
            self.answer_setup(SetupState::NothingToStore, None);
            return;
        }
        recorder.ask_setup(action, record);
    }

    /// Tells the host what is stored: the configuration itself if it was asked for, then the state.
    pub(crate) fn answer_setup(&mut self, state: SetupState, setup: Option<&Setup>) {
        let now = self.board.now();
        if let Some(setup) = setup {
            self.send(now, setup.configure);
            for row in setup.table.rows() {
                self.send(now, *row);
            }
            for row in setup.limbs.rows() {
                self.send(now, *row);
            }
        }
        let table_digest = setup.map_or(0, |setup| setup.table.digest());
        let answer = Stored {
            state,
            table_digest,
        };
        self.send(now, answer);
    }
}
