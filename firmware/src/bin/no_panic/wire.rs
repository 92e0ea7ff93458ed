//! `wire`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::ingest;
use surefix_core::wire::bits::{BitCursor, Bits};
use surefix_core::wire::broadcast::{Collector, Subframe};
use surefix_core::wire::crc;
use surefix_core::wire::native::{self, Frame, Kind, Reader, Writer};
use surefix_core::wire::nmea::{self, Angle, Fields};
use surefix_core::wire::rtcm3::{
    BroadcastEphemeris, Cell, Constellation, Message, Msm, MsmHeader, StationPosition, header,
    signals,
};
use surefix_core::wire::ubx::{self, NavPvt, Rawx, sfrbx};
use surefix_core::wire::{Counters, Scanner};

pub fn all() {
    let bytes: &[u8] = &[0; 64];
    call1(crc::crc24q, bytes);
    call1(crc::crc32, bytes);
    bits(bytes);
    native_frame(bytes);
    rtcm3(bytes);
    broadcast(bytes);
    scanner(bytes);
    u_blox(bytes);
    sentence();
}

fn sentence() {
    call1(Angle::latitude, 0.0);
    call1(Angle::longitude, 0.0);
    let fill = |fields: &mut Fields<'_>| {
        call1(Fields::empty, &mut *fields);
        call2(Fields::empties, &mut *fields, 2);
        call2(Fields::letter, &mut *fields, Some(b'N'));
        call3(Fields::integer, &mut *fields, 7, 2);
        call4(Fields::fixed, &mut *fields, Some(1.5), 3, 9999);
        call2(Fields::latitude, &mut *fields, Angle::latitude(1.5));
        call2(Fields::longitude, &mut *fields, Angle::longitude(1.5));
        call2(Fields::time, &mut *fields, Some([0; 4]));
        call2(Fields::date, fields, Some([1; 3]));
        Ok(())
    };
    call4(nmea::write, &mut [0; 100], *b"GN", *b"GGA", fill);
}

fn rtcm3(bytes: &[u8]) {
    let bits = Bits::new(bytes);
    call1(Message::parse, bytes);
    call2(BroadcastEphemeris::parse, bits, 1019);
    call1(StationPosition::parse, bits);
    call1(header::msm_kind, 1077);
    call4(MsmHeader::parse, bits, 1077, Constellation::Gps, 7);
    call2(signals::rinex_name, Constellation::Gps, 0);
    if let Ok(header) = MsmHeader::parse(bits, black_box(1077), Constellation::Gps, black_box(7)) {
        call1(MsmHeader::cells_announced, &header);
        call1(MsmHeader::len_bits, &header);
        call2(Msm::parse, bits, header);
        if let Ok(msm) = Msm::parse(bits, header) {
            call1(Msm::header, &msm);
            call1(Msm::constellation, &msm);
            call2(Msm::for_each_cell, &msm, |cell: Cell| {
                black_box(cell);
            });
        }
    }
}

fn u_blox(bytes: &[u8]) {
    call1(ubx::checksum, bytes);
    call1(ubx::Frame::parse, bytes);
    call1(ubx::Frame::from_checked, bytes);
    call1(Rawx::parse, bytes);
    if let Ok(rawx) = Rawx::parse(black_box(bytes)) {
        call1(|rawx| Rawx::measurements(rawx).last(), &rawx);
    }
    call1(sfrbx::parse, bytes);
    call1(NavPvt::parse, bytes);
    if let Ok(pvt) = NavPvt::parse(black_box(bytes)) {
        call1(NavPvt::is_position, &pvt);
        call1(ingest::receiver_fix, &pvt);
    }
}

fn broadcast(bytes: &[u8]) {
    let mut collector = Collector::EMPTY;
    let subframe = Subframe {
        gnss_id: black_box(0),
        sv_id: black_box(1),
        sig_id: black_box(0),
        words: bytes,
    };
    call2(Collector::take, &mut collector, &subframe);
    call1(Collector::clear, &mut collector);
}

fn scanner(bytes: &[u8]) {
    let (mut scanner, mut counters) = (Scanner::EMPTY, Counters::ZERO);
    call2(Scanner::feed, &mut scanner, bytes);
    call1(Scanner::bytes_in_hand, &scanner);
    call1(Scanner::end, &mut scanner);
    call2(Scanner::find, &mut scanner, &mut counters);
    call1(Scanner::frame, &scanner);
    call1(Scanner::release, &mut scanner);

    call1(Counters::decode, bytes);
    call2(Counters::encode, &counters, &mut [0; 200]);
    call1(
        |counters| Counters::rows(counters).map(|(_, value)| value).max(),
        &counters,
    );
}

fn bits(bytes: &[u8]) {
    call1(Bits::new, bytes);
    let bits = Bits::new(bytes);
    call1(Bits::len, &bits);
    call1(Bits::is_empty, &bits);
    call3(Bits::unsigned, &bits, 0, 0);
    call3(Bits::signed, &bits, 0, 0);
    call3(Bits::sign_magnitude, &bits, 0, 0);
    call2(BitCursor::new, bits, 0);
    let mut cursor = BitCursor::new(bits, 0);
    call1(BitCursor::position, &cursor);
    call2(BitCursor::skip, &mut cursor, 0);
    call2(BitCursor::unsigned, &mut cursor, 0);
    call2(BitCursor::signed, &mut cursor, 0);
}

fn native_frame(bytes: &[u8]) {
    call1(Kind::from_u8, 0);
    call1(Frame::expected_len, bytes);
    call1(Frame::parse, bytes);
    if let Ok((frame, _)) = Frame::parse(black_box(bytes)) {
        call1(Frame::kind, &frame);
        call1(Frame::kind_number, &frame);
        call1(Frame::payload, &frame);
        call1(Frame::reader, &frame);
    }

    let mut out = [0; 64];
    call1(|out| Writer::is_empty(&Writer::new(out)), &mut out);
    let mut writer = Writer::new(&mut out);
    call1(Writer::len, &writer);
    call2(Writer::put_bytes, &mut writer, bytes);
    call2(Writer::put_u8, &mut writer, 0);
    call2(Writer::put_u16, &mut writer, 0);
    call2(Writer::put_u32, &mut writer, 0);
    call2(Writer::put_u64, &mut writer, 0);
    call2(Writer::put_i64, &mut writer, 0);
    call2(Writer::put_f64, &mut writer, 0.0);
    call2(Writer::put_f32, &mut writer, 0.0);

    let mut reader = Reader::new(bytes);
    call1(Reader::left, &reader);
    call1(Reader::bytes::<7>, &mut reader);
    call1(Reader::u8, &mut reader);
    call1(Reader::u16, &mut reader);
    call1(Reader::u32, &mut reader);
    call1(Reader::u64, &mut reader);
    call1(Reader::i64, &mut reader);
    call1(Reader::f64, &mut reader);
    call1(Reader::f32, &mut reader);

    let fill = |writer: &mut Writer<'_>| writer.put_bytes(black_box(bytes));
    call3(native::encode, Kind::Report, &mut out, fill);
}
