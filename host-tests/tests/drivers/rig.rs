//! A driver and its part in common time.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;

use surefix_firmware::drivers::{
    Barometer, DriverCounters, Fault, InertialReading, InertialUnit, MagneticReading, Magnetometer,
    Phase, PressureReading, Readings, Supervised,
};
use surefix_host_tests::parts::{self, Bus, Motion, Part};

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
