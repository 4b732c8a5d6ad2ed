within ;
package Buildings "Stand-in for the tests: the few classes that ZeroshotRoom uses, with simple physics of our own"
  package Types
    package Tilt
      constant Real Ceiling = 0;
      constant Real Wall = 1.5707963267948966;
      constant Real Floor = 3.141592653589793;
    end Tilt;
    package Azimuth
      constant Real S = 0;
    end Azimuth;
  end Types;
  package BoundaryConditions
    package WeatherData
      connector Bus "Not expandable, as the library's is: the compiler does not add members to a connector"
        Real TDryBul;
        Real TBlaSky;
        Real winSpe;
        Real winDir;
        Real HGloHor;
      end Bus;
      model ReaderTMY3
        parameter String filNam;
        Buildings.BoundaryConditions.WeatherData.Bus weaBus;
        Modelica.Blocks.Sources.RealExpression TDryBul(y=275.15);
        Modelica.Blocks.Sources.RealExpression TBlaSky(y=262.15);
        Modelica.Blocks.Sources.RealExpression winSpe(y=3);
        Modelica.Blocks.Sources.RealExpression winDir(y=1);
        Modelica.Blocks.Sources.RealExpression HGloHor(y=300);
      equation
        connect(TDryBul.y, weaBus.TDryBul);
        connect(TBlaSky.y, weaBus.TBlaSky);
        connect(winSpe.y, weaBus.winSpe);
        connect(winDir.y, weaBus.winDir);
        connect(HGloHor.y, weaBus.HGloHor);
      end ReaderTMY3;
    end WeatherData;
    package SolarIrradiation
      block DirectTiltedSurface
        parameter Real til;
        parameter Real azi;
        Buildings.BoundaryConditions.WeatherData.Bus weaBus;
        Modelica.Blocks.Routing.RealPassThrough half;
        Modelica.Blocks.Interfaces.RealOutput H;
      equation
        connect(weaBus.HGloHor, half.u);
        H = 0.5*half.y;
      end DirectTiltedSurface;
      block DiffusePerez
        parameter Real til;
        parameter Real azi;
        parameter Real rho = 0.2;
        Buildings.BoundaryConditions.WeatherData.Bus weaBus;
        Modelica.Blocks.Routing.RealPassThrough part;
        Modelica.Blocks.Interfaces.RealOutput H;
      equation
        connect(weaBus.HGloHor, part.u);
        H = rho*part.y;
      end DiffusePerez;
    end SolarIrradiation;
  end BoundaryConditions;
  package Media
    package Air
      extends Modelica.Media.Interfaces.PartialMedium;
      constant String extraPropertiesNames[:] = fill("", 0);
      constant Real p_default = 101325;
      constant Real T_default = 293.15;
      constant Real X_default[2] = {0.01, 0.99};
      record ThermodynamicState
        Real p;
        Real T;
        Real X[2];
      end ThermodynamicState;
      function setState_pTX
        input Real p;
        input Real T;
        input Real X[2];
        output ThermodynamicState state;
      algorithm
        state.p := p;
        state.T := T;
        state.X := X;
      end setState_pTX;
      function molarMass "Dry air, so that the stand-in counts as the C twin does"
        input ThermodynamicState state;
        output Real MM;
      algorithm
        MM := 0.0289647;
      end molarMass;
    end Air;
  end Media;
  package HeatTransfer
    package Types
      type InteriorConvection = enumeration(Fixed, Temperature);
      type ExteriorConvection = enumeration(Fixed, TemperatureWind);
      type SurfaceRoughness = enumeration(VeryRough, Rough, Medium, MediumSmooth, Smooth, VerySmooth);
    end Types;
    package Convection
      model Exterior
        parameter Real A;
        parameter Buildings.HeatTransfer.Types.ExteriorConvection conMod;
        parameter Buildings.HeatTransfer.Types.SurfaceRoughness roughness;
        parameter Real til;
        parameter Real azi;
        Modelica.Blocks.Interfaces.RealInput v;
        Modelica.Blocks.Interfaces.RealInput dir;
        Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a solid;
        Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b fluid;
        Real dT;
      equation
        dT = solid.T - fluid.T;
        // 80 degree from north is where a south facade stands between windward and leeward
        solid.Q_flow = A*dT*(1.31*(dT^2 + 1e-4)^(1/6) + 2.537*(0.75 + 0*dir)*
          (if roughness == Buildings.HeatTransfer.Types.SurfaceRoughness.Medium then 1.52 else 1.0)*
          2/A^0.25*sqrt(v));
        solid.Q_flow + fluid.Q_flow = 0;
      end Exterior;
    end Convection;
  end HeatTransfer;
  package Fluid
    package Interfaces
      connector FluidPort
        Real p;
        flow Real m_flow;
        stream Real T_outflow;
        stream Real C_outflow;
      end FluidPort;
    end Interfaces;
    package Sources
      model MassFlowSource_T
        replaceable package Medium = Buildings.Media.Air;
        parameter Boolean use_m_flow_in = false;
        parameter Integer nPorts = 0;
        Modelica.Blocks.Interfaces.RealInput m_flow_in;
        Buildings.Fluid.Interfaces.FluidPort ports[nPorts];
      equation
        ports[1].m_flow = -m_flow_in;
        ports[1].T_outflow = 293.15;
        ports[1].C_outflow = 0;
      end MassFlowSource_T;
      model Boundary_pT
        replaceable package Medium = Buildings.Media.Air;
        parameter Boolean use_T_in = false;
        parameter Boolean use_C_in = false;
        parameter Integer nPorts = 0;
        Modelica.Blocks.Interfaces.RealInput T_in;
        Modelica.Blocks.Interfaces.RealInput C_in[1];
        Buildings.Fluid.Interfaces.FluidPort ports[nPorts];
      equation
        ports[1].p = 101325;
        ports[1].T_outflow = T_in;
        ports[1].C_outflow = C_in[1];
      end Boundary_pT;
    end Sources;
    package FixedResistances
      model PressureDrop
        replaceable package Medium = Buildings.Media.Air;
        parameter Boolean allowFlowReversal = true;
        parameter Boolean linearized = false;
        parameter Boolean from_dp = false;
        parameter Real dp_nominal;
        parameter Real m_flow_nominal;
        Buildings.Fluid.Interfaces.FluidPort port_a;
        Buildings.Fluid.Interfaces.FluidPort port_b;
      equation
        port_a.m_flow = m_flow_nominal*(port_a.p - port_b.p)/dp_nominal;
        port_a.m_flow + port_b.m_flow = 0;
        port_b.T_outflow = inStream(port_a.T_outflow);
        port_b.C_outflow = inStream(port_a.C_outflow);
        port_a.T_outflow = inStream(port_b.T_outflow);
        port_a.C_outflow = inStream(port_b.C_outflow);
      end PressureDrop;
    end FixedResistances;
    package Sensors
      model PPM
        replaceable package Medium = Buildings.Media.Air;
        parameter Boolean warnAboutOnePortConnection = true;
        Buildings.Fluid.Interfaces.FluidPort port;
        Modelica.Blocks.Interfaces.RealOutput ppm;
      equation
        port.m_flow = 0;
        port.T_outflow = 0;
        port.C_outflow = 0;
        ppm = inStream(port.C_outflow)*1e6*0.0289647/0.0440095;
      end PPM;
    end Sensors;
  end Fluid;
  package ThermalZones
    package Detailed
      package BaseClasses
        record OpaqueSurface
          parameter Real A;
          parameter Real til;
          parameter Real absIR = 0.84;
          parameter Real absSol = 0.84;
        end OpaqueSurface;
        model SkyRadiationExchange
          parameter Integer n;
          parameter Real A[n];
          parameter Real vieFacSky[n];
          parameter Real absIR[n];
          Modelica.Blocks.Interfaces.RealInput TOut;
          Modelica.Blocks.Interfaces.RealInput TBlaSky;
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a port[n];
        equation
          for i in 1:n loop
            port[i].Q_flow = A[i]*absIR[i]*Modelica.Constants.sigma*(port[i].T^4 - vieFacSky[i]*TBlaSky^4 -
              (1 - vieFacSky[i])*TOut^4);
          end for;
        end SkyRadiationExchange;
      end BaseClasses;
      model MixedAir "Dry air at constant mass, buoyant convection, one mean radiant node"
        replaceable package Medium = Buildings.Media.Air;
        parameter Integer nConExt;
        parameter Integer nConExtWin;
        parameter Integer nConPar;
        parameter Integer nConBou;
        parameter Integer nSurBou;
        parameter Integer nPorts;
        parameter Buildings.ThermalZones.Detailed.BaseClasses.OpaqueSurface surBou[nSurBou];
        parameter Real AFlo;
        parameter Real hRoo;
        final parameter Real V = AFlo*hRoo;
        parameter Boolean linearizeRadiation = true;
        parameter Boolean use_C_flow = false;
        parameter Buildings.HeatTransfer.Types.InteriorConvection intConMod;
        parameter Modelica.Fluid.Types.Dynamics energyDynamics;
        parameter Real T_start = 293.15;
        parameter Real C_start[1] = {0};
        parameter Real C_nominal[1] = {1e-2};
        Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a surf_surBou[nSurBou];
        Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a heaPorAir;
        Modelica.Blocks.Interfaces.RealInput qGai_flow[3];
        Modelica.Blocks.Interfaces.RealInput C_flow[1];
        Buildings.Fluid.Interfaces.FluidPort ports[nPorts];
        Real T(start=T_start, fixed=true);
        Real C(start=C_start[1], fixed=true);
        Real TMRT;
        Real d[nSurBou];
        Real qCon[nSurBou];
        Real qRad[nSurBou];
      equation
        heaPorAir.T = T;
        for i in 1:nSurBou loop
          d[i] = surf_surBou[i].T - T;
          // floor and ceiling are the first two; buoyancy helps where the floor is warm or the ceiling cold
          qCon[i] = surBou[i].A*d[i]*(d[i]^2 + 1e-4)^(1/6)*(if i > 2 then 1.31 else 1.135 + 0.375*
            (if i == 1 then 1 else -1)*d[i]/sqrt(d[i]^2 + 1e-4));
          qRad[i] = 4*surBou[i].absIR*Modelica.Constants.sigma*293.15^3*surBou[i].A*(surf_surBou[i].T - TMRT);
          surf_surBou[i].Q_flow = qCon[i] + qRad[i];
        end for;
        sum(qRad) + qGai_flow[1]*AFlo = 0;
        1.2*V*1006*der(T) = sum(qCon) + heaPorAir.Q_flow + qGai_flow[2]*AFlo +
          1006*ports[2].m_flow*(inStream(ports[2].T_outflow) - T);
        1.2*V*der(C) = C_flow[1] + ports[2].m_flow*(inStream(ports[2].C_outflow) - C);
        sum(ports.m_flow) = 0;
        for i in 2:nPorts loop
          ports[i].p = ports[1].p;
        end for;
        for i in 1:nPorts loop
          ports[i].T_outflow = T;
          ports[i].C_outflow = C;
        end for;
      end MixedAir;
    end Detailed;
  end ThermalZones;
end Buildings;
