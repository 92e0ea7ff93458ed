//! A driver and its part in common time.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;

use embedded_hal::spi::ErrorKind;
use surefix_firmware::drivers::supervision::SILENT_INTERVALS;
use surefix_firmware::drivers::{
    Barometer, DriverCounters, Fault, InertialReading, InertialUnit, MagneticReading, Magnetometer,
    Phase, PressureReading, Readings, Supervised,
};
use surefix_host_tests::parts::{self, Bus, Motion, Part};

/// What any part may do on the wires, and what its driver says of it.
const WIRES: [(parts::Fault, Fault); 3] = [
    (parts::Fault::AllOnes, Fault::Stuck { high: true }),
    (parts::Fault::AllZeros, Fault::Stuck { high: false }),
    (parts::Fault::BusError, Fault::Bus(ErrorKind::Overrun)),
];

/// How finely time runs, ns: the line and the driver's deadline are looked at so often.
pub const STEP_NS: u64 = 250_000;

/// A driver whose readings are all of one kind.
pub trait Driver: Supervised {
    type Reading: Copy;

    fn serve(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        readings: &mut Vec<Self::Reading>,
    ) -> Result<(), Fault>;
}

impl Driver for surefix_firmware::drivers::adis::Adis<Bus<parts::adis::Adis>> {
    type Reading = InertialReading;

    fn serve(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        all: &mut Vec<InertialReading>,
    ) -> Result<(), Fault> {
        let mut readings = Readings::new();
        let outcome = self.service(now_ns, data_ready_ns, &mut readings);
        all.extend(readings);
        outcome
    }
}

impl Driver for surefix_firmware::drivers::icm42688::Icm42688<Bus<parts::icm42688::Icm42688>> {
    type Reading = InertialReading;

    fn serve(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        all: &mut Vec<InertialReading>,
    ) -> Result<(), Fault> {
        let mut readings = Readings::new();
        let outcome = self.service(now_ns, data_ready_ns, &mut readings);
        all.extend(readings);
        outcome
    }
}

impl Driver for surefix_firmware::drivers::bmp390::Bmp390<Bus<parts::bmp390::Bmp390>> {
    type Reading = PressureReading;

    fn serve(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        all: &mut Vec<PressureReading>,
    ) -> Result<(), Fault> {
        all.extend(self.service(now_ns, data_ready_ns)?);
        Ok(())
    }
}

impl Driver for surefix_firmware::drivers::lis3mdl::Lis3mdl<Bus<parts::lis3mdl::Lis3mdl>> {
    type Reading = MagneticReading;

    fn serve(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        all: &mut Vec<MagneticReading>,
    ) -> Result<(), Fault> {
        all.extend(self.service(now_ns, data_ready_ns)?);
        Ok(())
    }
}

/// A driver, its part, and what came of them.
pub struct Rig<D: Driver, P> {
    pub driver: D,
    part: Rc<RefCell<P>>,
    pub motion: Motion,
    pub now_ns: u64,
    /// Of the last run.
    pub readings: Vec<D::Reading>,
    /// Of the last run.
    pub faults: Vec<Fault>,
}

impl<D: Driver, P: Part> Rig<D, P> {
    pub fn new(part: P, driver: impl FnOnce(Bus<P>) -> D) -> Self {
        let part = Rc::new(RefCell::new(part));
        Self {
            driver: driver(Bus::new(&part)),
            part,
            motion: Motion::REST,
            now_ns: 0,
            readings: Vec::new(),
            faults: Vec::new(),
        }
    }

    pub fn part(&self) -> RefMut<'_, P> {
        self.part.borrow_mut()
    }

    /// From now on this is wrong with the part, alone.
    pub fn break_with(&mut self, fault: parts::Fault) {
        self.mend();
        self.part().faults().set(fault);
    }

    pub fn mend(&mut self) {
        self.part().faults().clear();
    }

    /// Lets time run; the driver is called when the line is active, and when it wants to be.
    pub fn run_ns(&mut self, length_ns: u64) {
        self.readings.clear();
        self.faults.clear();
        let end_ns = self.now_ns + length_ns;
        while self.now_ns < end_ns {
            self.now_ns += STEP_NS;
            let motion = self.motion;
            self.part().advance(self.now_ns, &motion);
            let ready_ns = self.part().data_ready_ns();
            if ready_ns.is_some() || self.now_ns >= self.driver.next_ns() {
                self.serve(ready_ns);
            }
        }
    }

    /// Lets time run with nobody looking.
    pub fn sleep_ns(&mut self, length_ns: u64) {
        self.now_ns += length_ns;
        let motion = self.motion;
        self.part().advance(self.now_ns, &motion);
    }

    pub fn serve(&mut self, ready_ns: Option<u64>) {
        let outcome = self.driver.serve(self.now_ns, ready_ns, &mut self.readings);
        self.faults.extend(outcome.err());
    }

    /// One interval, and a call when the line is active.
    pub fn one_interval(&mut self) {
        self.readings.clear();
        self.faults.clear();
        self.sleep_ns(u64::from(self.driver.interval_ns()));
        let ready_ns = self.part().data_ready_ns();
        self.serve(ready_ns);
    }

    pub fn is_running(&self) -> bool {
        self.driver.phase() == Phase::Running
    }

    pub fn counters(&self) -> DriverCounters {
        self.driver.counters()
    }

    /// Starts and lets the first readings pass.
    pub fn started(mut self) -> Self {
        self.run_ns(1_000_000_000);
        assert!(self.is_running(), "{:?}", self.faults);
        assert_eq!(self.faults, []);
        self
    }

    /// A fault during the start: told and counted each second, no reading; once mended, the start succeeds.
    pub fn check_start_fault(mut self, wrong: parts::Fault, is_told: impl Fn(Fault) -> bool) {
        self.break_with(wrong);
        self.run_ns(3_500_000_000);
        assert!(!self.is_running());
        assert!(self.readings.is_empty());
        assert!(
            (3..=4).contains(&self.faults.len()) && self.faults.iter().all(|fault| is_told(*fault)),
            "{wrong:?}: {:?}",
            self.faults
        );
        assert_eq!(self.counters().starts, 0);
        self.mend();
        // A start that was under way may still fail.
        self.run_ns(1_500_000_000);
        self.run_ns(1_500_000_000);
        assert!(self.is_running(), "{:?}", self.faults);
        assert_eq!(self.faults, []);
        assert!(self.readings.len() > 20);
    }

    /// A fault while running: told as such and counted by `count`, no valid reading meanwhile; the driver
    /// starts the part again, and once mended readings come again.
    pub fn check_running_fault(
        mut self,
        wrong: parts::Fault,
        is_told: impl Fn(Fault) -> bool,
        count: impl Fn(DriverCounters) -> u32,
    ) {
        let before = self.counters();
        self.break_with(wrong);
        self.run_ns(1_000_000_000);
        assert!(self.readings.is_empty(), "{wrong:?}");
        let told = self.faults.iter().filter(|fault| is_told(**fault)).count();
        assert!(told >= 5, "{wrong:?}: {:?}", self.faults);
        assert!(count(self.counters()) >= count(before) + 5);
        self.mend();
        self.run_ns(3_000_000_000);
        assert!(self.is_running());
        assert!(self.readings.len() > 20);
        assert!(self.counters().starts > before.starts, "{wrong:?}");
    }
}

/// What any part may do on the wires while its driver starts it.
pub fn check_wires_at_a_start<D: Driver, P: Part>(make: impl Fn() -> Rig<D, P>) {
    for (wrong, told) in WIRES {
        make().check_start_fault(wrong, |fault| fault == told);
    }
}

/// What any part may do on the wires while running, silence included.
pub fn check_wires_while_running<D: Driver, P: Part>(make: impl Fn() -> Rig<D, P>) {
    for (wrong, told) in WIRES {
        make().started().check_running_fault(
            wrong,
            |fault| fault == told,
            |counters| match told {
                Fault::Bus(_) => counters.bus,
                _ => counters.stuck,
            },
        );
    }
    let started = make().started();
    let least_ns = SILENT_INTERVALS * u64::from(started.driver.interval_ns());
    started.check_running_fault(
        parts::Fault::Silent,
        |fault| matches!(fault, Fault::Silent { since_ns } if since_ns >= least_ns),
        |counters| counters.silent,
    );
}

/// A line that stays active: between restarts readings are taken as they come, each once.
pub fn check_stuck_line<D: Driver, P: Part>(
    mut rig: Rig<D, P>,
    time_ns: impl Fn(&D::Reading) -> u64,
) {
    rig.break_with(parts::Fault::StuckDataReady { active: true });
    rig.run_ns(2_000_000_000);
    assert!(rig.faults.iter().all(|fault| *fault == Fault::Repeated));
    assert!(rig.counters().repeated >= 5);
    for pair in rig.readings.windows(2) {
        assert!(time_ns(&pair[1]) > time_ns(&pair[0]));
    }
    rig.mend();
    rig.run_ns(1_000_000_000);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.faults, []);
    let interval_ns = u64::from(rig.driver.interval_ns());
    assert_eq!(rig.readings.len() as u64, 1_000_000_000 / interval_ns);
}

/// A sensor's test of itself that was passed is not made again: motion would make it fail.
pub fn check_test_made_once<D: Driver, P: Part>(mut rig: Rig<D, P>) {
    rig.break_with(parts::Fault::AllOnes);
    rig.run_ns(200_000_000);
    rig.break_with(parts::Fault::SelfTestFails);
    rig.run_ns(2_000_000_000);
    assert!(rig.is_running());
}

/// Each bit of each of these transfers of a call turned alone, `bytes` long: what is given is what a clean
/// call gives. Tells how many were noticed.
pub fn check_each_turned_bit<D: Driver, P: Part>(
    mut rig: Rig<D, P>,
    transfers: [(u32, usize); 2],
    is_same: impl Fn(&D::Reading, &D::Reading) -> bool,
) -> usize {
    rig.one_interval();
    let truth = rig.readings[0];
    let mut told = 0;
    for (transfer, bytes) in transfers {
        for bit in 0..8 * bytes {
            rig.mend();
            rig.one_interval();
            rig.mend();
            rig.part()
                .faults()
                .set(parts::Fault::FlipOnce { transfer, bit });
            rig.one_interval();
            assert!(rig.readings.iter().all(|reading| is_same(reading, &truth)));
            told += rig.faults.len();
        }
    }
    told
}

/// Bits turned at random, one in a thousand, for 400 s: how many readings were given, and how many of them wrong.
pub fn readings_under_turned_bits<D: Driver, P: Part>(
    mut rig: Rig<D, P>,
    seed: u64,
    is_same: impl Fn(&D::Reading, &D::Reading) -> bool,
) -> (usize, usize) {
    rig.one_interval();
    let truth = rig.readings[0];
    rig.break_with(parts::Fault::FlipBits {
        probability: 1e-3,
        seed,
    });
    let (mut all, mut wrong) = (0, 0);
    for _ in 0..400 {
        rig.run_ns(1_000_000_000);
        all += rig.readings.len();
        wrong += rig
            .readings
            .iter()
            .filter(|reading| !is_same(reading, &truth))
            .count();
    }
    println!("turned bits 1e-3: {all} readings, {wrong} of them wrong");
    (all, wrong)
}

/// An error of the bus at each of the first transfers, one at a time: it is told once and the driver comes
/// back; a reading that was lost is missed by the next.
pub fn check_each_bus_error<D: Driver, P: Part>(make: impl Fn() -> Rig<D, P>, transfers: u32) {
    for transfer in 0..transfers {
        let mut rig = make();
        rig.break_with(parts::Fault::BusErrorOnce { transfer });
        rig.run_ns(3_000_000_000);
        let faults = std::mem::take(&mut rig.faults);
        assert!(
            matches!(faults[..], [Fault::Bus(_)]),
            "transfer {transfer}: {faults:?}"
        );
        assert!(rig.is_running());
        assert_eq!(rig.counters().starts, 1);
        assert_eq!(rig.counters().bus, 1);
    }
}
